// node write_mcap.mjs FILE FOLDER: the raw samples of a file of ours, written again by somebody else's writer in every
// way that MCAP knows; times counted from the reference's first sample.
import { MessageWriter } from "@foxglove/rosmsg2-serialization";
import { parse } from "@foxglove/rosmsg";
import { McapWriter } from "@mcap/core";
import { spawnSync } from "node:child_process";
import { mkdirSync, writeFileSync } from "node:fs";
import { decoderOf, expect, indexed, nanoseconds, zstd } from "./common.mjs";

const [file, folder] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
// Debian's lz4 writes frames; the package of npm only reads them.
function compressLz4(bytes) {
  const packed = spawnSync("lz4", ["-c", "-q"], { input: bytes, maxBuffer: 1 << 28 });
  expect(packed.status === 0, "lz4 failed; run tools/setup --doors");
  return packed.stdout;
}
const kinds = {
  zstd: { options: { compressChunk: (bytes) => ({ compression: "zstd", compressedData: zstd.compress(bytes, 1) }) } },
  lz4: { options: { compressChunk: (bytes) => ({ compression: "lz4", compressedData: compressLz4(bytes) }) } },
  plain: { options: {} },
  unchunked: { options: { useChunks: false } },
  unindexed: { options: { useMessageIndex: false, useChunkIndex: false, useStatistics: false, useSummaryOffsets: false,
                          repeatChannels: false, repeatSchemas: false } },
  json: { options: {}, json: true },
};
class Memory {
  parts = [];
  size = 0n;
  async write(bytes) {
    this.parts.push(bytes.slice());
    this.size += BigInt(bytes.length);
  }
  position() {
    return this.size;
  }
}
const topics = (topic) => topic.endsWith("/raw") || topic.startsWith("/gnss");
const reader = await indexed(file);
for (const [kind, { options, json }] of Object.entries(kinds)) {
  const memory = new Memory();
  const writer = new McapWriter({ writable: memory, chunkSize: 700000, ...options });
  await writer.start({ profile: json ? "" : "ros2", library: "somebody else's" });
  const ways = new Map();
  let begin;
  let sequence = 0;
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    if (!topics(channel.topic)) continue;
    if (channel.topic === "/imu/airins/raw") begin ??= message.logTime;
    if (begin === undefined) continue;
    let way = ways.get(channel.id);
    if (way === undefined) {
      const schema = reader.schemasById.get(channel.schemaId);
      const text = new TextDecoder().decode(schema.data);
      const schemaId = await writer.registerSchema(
        json ? { name: schema.name, encoding: "jsonschema", data: new TextEncoder().encode("{}") }
             : { name: schema.name, encoding: "ros2msg", data: schema.data });
      const id = await writer.registerChannel({ topic: channel.topic, schemaId, messageEncoding: json ? "json" : "cdr", metadata: new Map() });
      way = { id, read: decoderOf(schema), writer: new MessageWriter(parse(text, { ros2: true })) };
      ways.set(channel.id, way);
    }
    const object = way.read(message.data);
    let stamp = nanoseconds(object.header.stamp) - begin;
    if (stamp < 0n) continue;
    // The CSV files have no sd of velocities.
    if (object.twist) object.twist.covariance.fill(0);
    object.header.stamp = { sec: Number(stamp / 1000000000n), nanosec: Number(stamp % 1000000000n) };
    const plain = (key, value) => (ArrayBuffer.isView(value) ? Array.from(value) : value);
    const data = json ? new TextEncoder().encode(JSON.stringify(object, plain)) : way.writer.writeMessage(object);
    await writer.addMessage({ channelId: way.id, sequence: sequence++, logTime: message.logTime, publishTime: message.logTime, data });
  }
  await writer.end();
  writeFileSync(`${folder}/${kind}.mcap`, Buffer.concat(memory.parts));
  console.log(`${folder}/${kind}.mcap: ${sequence} messages, ${memory.size} bytes`);
}
