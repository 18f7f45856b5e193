// Connect to a bridge with Foxglove's own client, decode a message of each topic with
// Foxglove's own decoder, and drive a robot meanwhile. Prints what was found as JSON.
// Arguments: the folder with node_modules, the port of the bridge, the topic to drive
// on, and the topics to wait for.
import { createRequire } from "node:module";

const [folder, port, driven, ...wanted] = process.argv.slice(2);
const require = createRequire(`${folder}/`);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const { WebSocket } = require("ws");

const socket = new WebSocket(`ws://127.0.0.1:${port}`, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
const client = new FoxgloveClient({ ws: socket });
const found = { topics: {}, messages: {}, stamps: {}, times: [], status: [], info: null };
const channels = new Map(); // by subscription

client.on("serverInfo", (info) => (found.info = info));
client.on("status", (status) => found.status.push(status.message));
client.on("time", ({ timestamp }) => found.times.push(Number(timestamp)));
client.on("advertise", (news) => {
  for (const channel of news) {
    found.topics[channel.topic] = channel.schemaName;
    channels.set(client.subscribe(channel.id), channel);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, schema } = channels.get(subscriptionId);
  const definition = parse(schema, { ros2: true });
  const message = new MessageReader(definition).readMessage(data);
  found.messages[topic] = summary(message);
  found.stamps[topic] = Number(timestamp);
  if (wanted.every((each) => each in found.messages) && found.times.length > 50) {
    console.log(JSON.stringify(found));
    process.exit(0);
  }
});

/** Arrays by their lengths: scenes have hundreds of thousands of points. */
function summary(value) {
  if (Array.isArray(value) && value.length > 64) return value.length;
  if (ArrayBuffer.isView(value)) return value.length;
  if (Array.isArray(value)) return value.map(summary);
  if (typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, summary(each)]));
}

client.on("open", () => {
  const vector = "float64 x\nfloat64 y\nfloat64 z";
  const type = "geometry_msgs/Vector3";
  const text = `${type} linear\n${type} angular\n===\nMSG: ${type}\n${vector}`;
  const writer = new MessageWriter(parse(text, { ros2: true }));
  const still = { x: 0, y: 0, z: 0 };
  const twist = { linear: { ...still, x: 0.3 }, angular: still };
  const number = client.advertise({ topic: driven, encoding: "cdr", schemaName: "geometry_msgs/Twist" });
  setInterval(() => client.sendMessage(number, writer.writeMessage(twist)), 100);
});
