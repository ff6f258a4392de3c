// Reads an MCAP file with @mcap/core and protobufjs, neither of them ours, and prints what is in it as JSON.
import { readFile, writeFile } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { foxgloveMessageSchemas } from "@foxglove/schemas/internal.js";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const [file, pictureFile] = process.argv.slice(2);
const bytes = await readFile(file);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
};
const reader = await McapIndexedReader.Initialize({ readable });

const topics = {};
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  topics[channel.topic] = { encoding: channel.messageEncoding, schema: schema.name, schemaEncoding: schema.encoding, messages: 0 };
}

let firstImage = null;
let lastLogTime = 0n;
let ordered = true;
const frames = [];
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  topics[channel.topic].messages += 1;
  ordered &&= message.logTime >= lastLogTime;
  lastLogTime = message.logTime;
  if (channel.topic === "/camera/image" && firstImage === null) {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    const type = root.lookupType(schema.name);
    const image = type.decode(message.data);
    await writeFile(pictureFile, image.data);
    firstImage = { format: image.format, frameId: image.frameId, seconds: Number(image.timestamp.seconds), fields: Object.keys(type.fields).sort() };
  }
  if (channel.topic === "/camera/frame") frames.push(JSON.parse(new TextDecoder().decode(message.data)));
}
const attachments = [];
for await (const attachment of reader.readAttachments()) attachments.push(attachment.name);
const expectedImageFields = foxgloveMessageSchemas.CompressedImage.fields.map((field) => field.name).sort();
console.log(JSON.stringify({
  profile: reader.header.profile, topics, firstImage, expectedImageFields, ordered, attachments, frames,
  statistics: Number(reader.statistics.messageCount),
}));
