// Reads flight data in MCAP with @mcap/core and protobufjs, neither of them ours, and prints what is in them as JSON.
import { readFile } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { foxgloveMessageSchemas } from "@foxglove/schemas/internal.js";
import { decompress } from "fzstd";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const bytes = await readFile(process.argv[2]);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
};
const decompressHandlers = { zstd: (buffer, size) => decompress(buffer, new Uint8Array(Number(size))) };
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });

const topics = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  const seen = (topics[channel.topic] ??= { schema: schema.name, schemaEncoding: schema.encoding, messages: [] });
  let content;
  if (channel.messageEncoding === "json") {
    content = JSON.parse(new TextDecoder().decode(message.data));
  } else {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    const type = root.lookupType(schema.name);
    seen.fields = Object.keys(type.fields).map((name) => name.replaceAll("_", "").toLowerCase()).sort();
    content = type.toObject(type.decode(message.data), { longs: Number, enums: String, bytes: String });
  }
  seen.messages.push({ logTime: String(message.logTime), publishTime: String(message.publishTime), content });
}
const published = (name) => foxgloveMessageSchemas[name].fields.map((field) => field.name.replaceAll("_", "").toLowerCase()).sort();
console.log(JSON.stringify({
  profile: reader.header.profile, topics,
  published: { ImageAnnotations: published("ImageAnnotations"), CompressedImage: published("CompressedImage") },
}));
