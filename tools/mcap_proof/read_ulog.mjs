// A ULog by @foxglove/ulog: the numbers of its messages, and vehicle_imu/0 as a table of rates and forces.
// Usage: node read_ulog.mjs FILE.ulg TABLE.csv
import { ULog } from "@foxglove/ulog";
import { FileReader } from "@foxglove/ulog/node.js";
import { writeFileSync } from "node:fs";

const log = new ULog(new FileReader(process.argv[2]));
await log.open();
const names = new Map([...log.subscriptions.entries()].map(([id, s]) => [id, `${s.name}/${s.multiId}`]));
const counts = {};
const rows = ["t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"];
for await (const message of log.readMessages()) {
  const name = names.get(message.msgId);
  if (message.value === undefined || name === undefined) continue;  // no data: a subscription, a text
  counts[name] = (counts[name] ?? 0) + 1;
  if (name !== "vehicle_imu/0") continue;
  const { timestamp_sample: us, delta_angle: angle, delta_velocity: velocity, delta_angle_dt, delta_velocity_dt } = message.value;
  const ns = us * 1000n - BigInt(delta_angle_dt) * 500n;
  const t = `${ns / 1000000000n}.${(ns % 1000000000n).toString().padStart(9, "0")}`;
  rows.push([t, ...[...angle].map((v) => v / (delta_angle_dt * 1e-6)), ...[...velocity].map((v) => v / (delta_velocity_dt * 1e-6))].join(","));
}
writeFileSync(process.argv[3], rows.join("\n") + "\n");
console.log(JSON.stringify(counts));
