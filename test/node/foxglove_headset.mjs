// A headset by the Foxglove protocol's own client: publishes what a file says, looks once a second until the calibration is
// OK, and prints that.
// node foxglove_headset.mjs URL SCENARIO

import { readFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";
import foxglove from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, path] = process.argv.slice(2);
const { first, looks } = JSON.parse(readFileSync(path));
const client = new foxglove.FoxgloveClient({ ws: new WebSocket(url, ["foxglove.websocket.v1"]) });
const mine = new Map();
let reader, timer;

function fail(error) {
  console.error(error);
  process.exit(1);
}

function publish({ topic, schemaName, schema, message }) {
  if (!mine.has(topic)) {
    const writer = new MessageWriter(parse(schema, { ros2: true }));
    mine.set(topic, { id: client.advertise({ topic, encoding: "cdr", schemaName }), writer });
  }
  const { id, writer } = mine.get(topic);
  client.sendMessage(id, writer.writeMessage(message));
}

function look() {
  const next = looks.shift();
  if (!next) fail("no calibration after all looks");
  next.forEach(publish);
}

client.on("error", fail);
client.on("status", (status) => fail(status.message));
client.on("advertise", (channels) => {
  const { id, schema } = channels.find(({ topic }) => topic === "/calibration");
  reader = new MessageReader(parse(schema, { ros2: true }), { timeType: "sec,nanosec" });
  client.subscribe(id);
  first.forEach(publish);
  look();
  timer = setInterval(look, 1000);
});
client.on("message", ({ data }) => {
  const result = reader.readMessage(data);
  if (result.verdict !== 1) return;
  clearInterval(timer);
  const plain = (_, value) =>
    typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? [...value] : value;
  console.log(JSON.stringify(result, plain));
  client.close();
});
