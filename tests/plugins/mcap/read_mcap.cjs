// What Foxglove's own reader finds in MCAP files: node read_mcap.cjs FOLDER_OF_NODE_MODULES FILE…, as JSON.
const { createRequire } = require("node:module");
const { open } = require("node:fs/promises");
const use = createRequire(process.argv[2] + "/");

async function read(path) {
  const { McapIndexedReader } = use("@mcap/core");
  const { FileHandleReadable } = use("@mcap/nodejs");
  const { loadDecompressHandlers, protobufFromBinaryDescriptor } = use("@mcap/support");
  const decompressHandlers = await loadDecompressHandlers();
  const handle = await open(path, "r");
  const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle), decompressHandlers });
  const types = new Map();
  const found = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    let content;
    if (channel.messageEncoding === "json") {
      content = JSON.parse(new TextDecoder().decode(message.data));
    } else {
      if (!types.has(schema.id)) {
        types.set(schema.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
      }
      const type = types.get(schema.id);
      content = type.toObject(type.decode(message.data), { longs: Number, bytes: String, arrays: true, defaults: true, json: true });
    }
    (found[channel.topic] ??= []).push([Number(message.logTime), message.sequence, schema.name, content]);
  }
  await handle.close();
  return found;
}

Promise.all(process.argv.slice(3).map(read)).then((all) => process.stdout.write(JSON.stringify(all)));
