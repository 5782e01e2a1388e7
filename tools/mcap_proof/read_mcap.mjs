// node read_mcap.mjs FILE [FOLDER]: what others find in a file of ours. With FOLDER every IMU and the receiver as CSV, times
// counted from the reference's first sample.
import { mkdirSync, writeFileSync } from "node:fs";
import { decoderOf, expect, indexed, nanoseconds, secondsText, streamed } from "./common.mjs";

const [file, folder] = process.argv.slice(2);

const counts = {};
const channels = new Map();
let chunks = 0;
streamed(file, (record) => {
  if (record.type === "Channel") channels.set(record.id, record.topic);
  if (record.type === "Message") counts[channels.get(record.channelId)] = (counts[channels.get(record.channelId)] ?? 0) + 1;
  if (record.type === "MessageIndex") chunks += 1;
});

const reader = await indexed(file);
expect(reader.header.profile === "ros2", "the profile is not ros2");
expect(reader.statistics !== undefined, "there are no statistics");
const decoders = new Map();
const again = {};
const rows = {};
const velocities = new Map();
let begin;
let last = 0n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  again[channel.topic] = (again[channel.topic] ?? 0) + 1;
  expect(message.logTime >= last, "the index does not bring messages in the order of their times");
  last = message.logTime;
  if (channel.messageEncoding === "json") {
    const object = JSON.parse(new TextDecoder().decode(message.data));
    const { properties } = JSON.parse(new TextDecoder().decode(schema.data));
    for (const [key, value] of Object.entries(object)) {
      const type = properties[key]?.type;
      const fits =
        (type === "number" && (value === null || typeof value === "number")) || (type === "integer" && Number.isInteger(value)) ||
        (type === "string" && typeof value === "string") || (type === "array" && Array.isArray(value));
      expect(fits, `${channel.topic}: ${key} = ${value} is no ${type}`);
    }
    continue;
  }
  expect(channel.messageEncoding === "cdr" && schema.encoding === "ros2msg", `${channel.topic} is neither JSON nor CDR`);
  if (!decoders.has(schema.id)) decoders.set(schema.id, decoderOf(schema));
  const object = decoders.get(schema.id)(message.data);
  if (object.header) expect(nanoseconds(object.header.stamp) === message.logTime, `${channel.topic}: stamp and log time differ`);
  const t = message.logTime;
  if (schema.name === "sensor_msgs/msg/Imu") {
    if (channel.topic === "/imu/airins/raw") begin ??= t;
    const { angular_velocity: w, linear_acceleration: f } = object;
    (rows[channel.topic] ??= []).push([t, w.x, w.y, w.z, f.x, f.y, f.z]);
    const covariance = object.angular_velocity_covariance;
    if (channel.topic.endsWith("/corrected")) expect(covariance[0] > 0 && covariance[4] > 0 && covariance[8] > 0, "no covariance");
  }
  if (schema.name === "geometry_msgs/msg/TwistWithCovarianceStamped") velocities.set(t, object.twist.twist.linear);
  if (schema.name === "sensor_msgs/msg/NavSatFix") {
    const v = velocities.get(t) ?? { x: NaN, y: NaN, z: NaN };
    const p = object.position_covariance;
    (rows[channel.topic] ??= []).push(
      [t, object.latitude, object.longitude, object.altitude, v.y, v.x, -v.z, Math.sqrt(p[4]), Math.sqrt(p[0]), Math.sqrt(p[8])]);
  }
}
expect(JSON.stringify(Object.entries(counts).sort()) === JSON.stringify(Object.entries(again).sort()),
       "the two readers count differently");
let sum = 0n;
for (const [id, n] of reader.statistics.channelMessageCounts) {
  const topic = reader.channelsById.get(id).topic;
  expect(BigInt(again[topic] ?? 0) === n, `${topic}: the statistics count ${n}`);
  sum += n;
}
expect(sum === reader.statistics.messageCount, "the statistics do not add up");
const attachments = [];
for await (const attachment of reader.readAttachments({ validateCrcs: true })) attachments.push(`${attachment.name} ${attachment.data.length}`);
const metadata = {};
for await (const record of reader.readMetadata()) metadata[record.name] = Object.fromEntries(record.metadata);
console.log(JSON.stringify({ messages: Number(sum), counts, attachments, metadata }, null, 1));

if (folder !== undefined) {
  mkdirSync(folder, { recursive: true });
  const imu = "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
  const gnss = "t_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,v_d_mps,sd_n_m,sd_e_m,sd_d_m\n";
  for (const [topic, table] of Object.entries(rows)) {
    if (topic.endsWith("/corrected")) continue;
    const text = table.filter(([t]) => t >= begin).map(([t, ...values]) => [secondsText(t - begin), ...values].join(",")).join("\n");
    writeFileSync(`${folder}/${topic.split("/")[2]}.csv`, (topic.startsWith("/imu") ? imu : gnss) + text + "\n");
  }
}
