// A client of the Foxglove WebSocket protocol by its authors' own packages: prints one message of each channel as JSON.
// node foxglove_peer.mjs URL SUBPROTOCOL

import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import foxglove from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, protocol] = process.argv.slice(2);
const socket = new WebSocket(url, [protocol]);
const client = new foxglove.FoxgloveClient({ ws: socket });
const channels = new Map();
const read = {};

function plain(key, value) {
  if (typeof value === "bigint") return Number(value);
  return ArrayBuffer.isView(value) ? [...value] : value;
}

function fail(error) {
  console.error(error);
  process.exit(1);
}

client.on("error", fail);
client.on("status", (status) => fail(status.message));
client.on("advertise", (all) => {
  for (const channel of all) {
    const schema = parse(channel.schema, { ros2: true });
    const reader = new MessageReader(schema, { timeType: "sec,nanosec" });
    channels.set(client.subscribe(channel.id), { topic: channel.topic, reader });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { topic, reader } = channels.get(subscriptionId);
  read[topic] ??= reader.readMessage(data);
  if (Object.keys(read).length < channels.size) return;
  console.log(JSON.stringify({ protocol: socket.protocol, read }, plain));
  client.close();
});
