// What both directions share: unpacking, messages of ROS by the schemas in the file, our topics.
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const require = createRequire(import.meta.url);
export const zstd = require("@foxglove/wasm-zstd");
export const lz4 = require("@foxglove/wasm-lz4").default ?? require("@foxglove/wasm-lz4");
await zstd.isLoaded;
await (lz4.isLoaded ?? require("@foxglove/wasm-lz4").isLoaded);

export const decompressHandlers = {
  zstd: (bytes, size) => zstd.decompress(bytes, Number(size)),
  lz4: (bytes, size) => lz4(bytes, Number(size)),
};

export function fail(what) {
  console.error(`mcap_proof: ${what}`);
  process.exit(1);
}
export function expect(holds, what) {
  if (!holds) fail(what);
}

export function decoderOf(schema) {
  const reader = new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
  return (data) => reader.readMessage(data);
}
export const nanoseconds = (stamp) => BigInt(stamp.sec) * 1000000000n + BigInt(stamp.nanosec ?? stamp.nsec);
/// Seconds with nine decimals: what a CSV file holds exactly.
export function secondsText(ns) {
  const sign = ns < 0n ? "-" : "";
  const size = ns < 0n ? -ns : ns;
  return `${sign}${size / 1000000000n}.${(size % 1000000000n).toString().padStart(9, "0")}`;
}

/// Every record of a file, by the reader that goes through it from its beginning, all CRCs checked.
export function streamed(file, onRecord) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(new Uint8Array(readFileSync(file)));
  for (let record; (record = reader.nextRecord()); ) onRecord(record);
  expect(reader.done(), `${file}: the reader did not come to a footer`);
}
export async function indexed(file) {
  const bytes = readFileSync(file);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
  };
  return McapIndexedReader.Initialize({ readable, decompressHandlers });
}
