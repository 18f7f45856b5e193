// Read an MCAP file by the indexed and the streaming reader of @mcap/core, and print
// how many messages of each topic each of them finds. Both check all checksums.
import { open, readFile } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(`${process.argv[2]}/`); // folder with node_modules
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const zstd = require("@foxglove/wasm-zstd");

await zstd.isLoaded;
const decompressHandlers = {
  zstd: (data, size) => zstd.decompress(data, Number(size)),
};
const count = (counts, topic) => (counts[topic] = (counts[topic] ?? 0) + 1);

async function readIndexed(path) {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const data = new Uint8Array(Number(length));
      await file.read(data, 0, data.length, Number(offset));
      return data;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const counts = {};
  for await (const message of reader.readMessages()) {
    count(counts, reader.channelsById.get(message.channelId).topic);
  }
  await file.close();
  return counts;
}

async function readStream(path) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(await readFile(path));
  const topics = new Map();
  const counts = {};
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type === "Message") count(counts, topics.get(record.channelId));
  }
  if (!reader.done()) throw new Error("the stream has no end");
  return counts;
}

const path = process.argv[3];
const result = { indexed: await readIndexed(path), stream: await readStream(path) };
console.log(JSON.stringify(result));
