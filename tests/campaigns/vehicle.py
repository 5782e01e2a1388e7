"""The vehicle that campaigns put together: one table of every kind of device that imuscope reads, and configurations of them."""

REFERENCE = """
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
rate_hz = 100.0
axes = "+x -y -z"
transport = {{ kind = "serial", port = "{ports}/airins", baud = 460800 }}
[device.noise]
gyro_white_deg_per_sqrt_h = 0.0015
accel_white_ug_per_sqrt_hz = 10.0
gyro_bias_sd_deg_per_h = 0.005
accel_bias_sd_mps2 = 5e-4
"""
# A mounting that is roughly known: errors flow from the first seconds on.
PRIOR = ("prior = {{ rotation_vector_b_s_deg = [0.0, 0.0, 0.0], boresight_sd_deg = 3.0, lever_arm_sd_m = 0.5, "
         "time_offset_ms = 0.0, time_offset_sd_ms = 10.0 }}\n")


def study(name, protocol, transport, more=""):
    return (f'\n[[device]]\nname = "{name}"\nrole = "study"\nprotocol = "{protocol}"\nrate_hz = 100.0\n'
            f'transport = {{{{ {transport} }}}}\n{more}{PRIOR}')


def serial(name, baud):
    return f'kind = "serial", port = "{{ports}}/{name}", baud = {baud}'


def gnss(protocol, transport):
    return (f'\n[[device]]\nname = "gnss"\nrole = "gnss"\nprotocol = "{protocol}"\nrate_hz = 10.0\n'
            f'antenna_lever_arm_b_m = [-0.50, 0.20, -1.30]\ntransport = {{{{ {transport} }}}}\n')


def imu(name, more=""):
    return (f'[[simulation.imu]]\nname = "{name}"\nrotation_vector_b_s_deg = [0.8, -1.1, 0.6]\n'
            f'lever_arm_b_m = [0.35, -0.22, 0.12]\nlatency_ms = 2.0\n{more}')


WHEELS = ('\n[[device]]\nname = "wheels"\nrole = "odometry"\nprotocol = "can_odometry"\nrate_hz = 80.0\n'
          'transport = {{ kind = "can", interface = "can0" }}\n[device.odometry]\ndbc = "simulated_vehicle.dbc"\n'
          'speed_signals = ["WHEEL_SPEEDS.RL", "WHEEL_SPEEDS.RR"]\naxle_lever_arm_b_m = [0.0, 0.0, 0.5]\n')


class Kind:
    """A kind of device: its tables in a configuration, and what a message of it is."""

    def __init__(self, name, key, tables, truth="", rate=100.0, boot_s=0.0, message=0, checksum=True, whole=True,
                 counts=True, group=1, blocks=None, samples=1, can=False):
        self.name, self.key, self.tables, self.truth = name, key, tables, truth
        self.rate, self.boot_s = rate, boot_s  # samples/s; from power to the first message
        self.message = message      # bytes
        self.checksum = checksum    # damage is always found
        self.whole = whole          # any damage costs the sample; else only that to some of its parts
        self.counts = counts        # a counter that does not begin anew with power, or a time tag
        self.group = group          # messages (CAN frames) a sample
        self.blocks = blocks        # what "missing" leaves out, and whether that costs the sample
        self.samples = samples      # that one message gives
        self.can = can

    @property
    def role(self):
        return {"airins": "reference", "gnss": "gnss", "wheels": "odometry"}.get(self.key, "study")


XBUS = (study("head", "xsens_mt", serial("xbus", 460800), "bus_id = 1\n") +
        study("second", "xsens_mt", serial("xbus", 460800), "bus_id = 2\n"))
TCP = 'kind = "tcp", host = "127.0.0.1", port = 29301'
# Sizes: Airins telegram, MTData and MTData2 as the sessions ask for them, epochs as the receivers send them.
KINDS = [
    Kind("airins", "airins", "", rate=100, boot_s=5.0, samples=2, counts=False, blocks=(["raw_acceleration"], 1)),
    Kind("mtx", "mtx", study("mtx", "xsens_mt", serial("mtx", 115200)), imu("mtx"), boot_s=2.2, counts=False),
    Kind("mti", "mti", study("mti", "xsens_mt", serial("mti", 115200)), imu("mti", 'model = "mti"\n'), boot_s=2.2,
         counts=False),
    Kind("xbus", "head", XBUS, imu("head") + imu("second"), boot_s=2.2, counts=False, blocks=(["1"], 1)),
    Kind("greis", "gnss", gnss("greis", serial("gnss", 115200)), rate=10, boot_s=20.0, whole=False,
         blocks=(["VG", "SG"], 0)),
    Kind("nmea", "gnss", gnss("nmea", serial("gnss", 115200)), rate=10, boot_s=20.0, whole=False,
         blocks=(["GST"], 0)),
    Kind("ubx", "gnss", gnss("ubx", serial("gnss", 115200)), rate=10, boot_s=20.0),
    Kind("rtklib", "gnss", gnss("rtklib_pos", TCP), rate=10, boot_s=20.0, checksum=False),
    Kind("xsens_can", "mtic", study("mtic", "xsens_can", 'kind = "can", interface = "can0"'), imu("mtic"),
         counts=False, group=5, can=True),
    Kind("wheels", "wheels", WHEELS, rate=80, counts=False, can=True),
]
GREIS = next(kind for kind in KINDS if kind.name == "greis")
BYSTANDER = study("by", "xsens_mt", serial("by", 115200))


def configuration(kinds, ports, length_s, with_bystander=True):
    """One reference, the devices, a receiver, and one S-IMU that nothing happens to."""
    kinds = [kind for kind in kinds if kind.key != "airins"]
    if not any(kind.role == "gnss" for kind in kinds):
        kinds.append(GREIS)
    text = '[run]\nname = "faults"\n' + REFERENCE + "".join(kind.tables for kind in kinds)
    truth = "".join(kind.truth for kind in kinds)
    if with_bystander:
        text, truth = text + BYSTANDER, truth + imu("by")
    text = text.format(ports=ports)
    return text + f"\n[simulation]\nduration_s = {length_s}\ninitial_standstill_s = 12.0\nseed = 7\n" + truth
