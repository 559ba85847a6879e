// Worker: connection, decoding and map following.

import * as calls from "./calls.js";
import * as messages from "./messages.js";
import { Follower } from "./follower.js";

const PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const MESSAGE_DATA = 1;
const HEADER = 13;
// On a slow link only keys and counts of the map are subscribed to.
const THIN = self.location.search === "?thin=1" ? "_thin" : "";
const MOST_TILES = 200;

let socket = null;
let session = null;
let retry = 250;
let follower = new Follower();
// Free space, while it is shown.
let free = new Follower();
let channels = new Map();
let subscriptions = new Map();
let nextSubscription = 1;
// Nodes that publish each topic.
let published = new Map();
let changed = false;
const rates = new Map();
const wanted = new Set(["tf", "static", "map", "updates", "diagnostics", "calibration", "names", "drive", "loops"]);

// Decoder of each channel, by type and topic suffix.
const KINDS = [
  ["map", "lattice_msgs/msg/LatticeMap", new RegExp(`map${THIN}$`)],
  ["free", "lattice_msgs/msg/LatticeMap", /(^|\/)free$/],
  ["updates", "lattice_msgs/msg/LatticeMapUpdate", new RegExp(`updates${THIN}$`)],
  ["static", "tf2_msgs/msg/TFMessage", /tf_static$/],
  ["tf", "tf2_msgs/msg/TFMessage", /./],
  ["diagnostics", "diagnostic_msgs/msg/DiagnosticArray", /./],
  ["calibration", "lattice_msgs/msg/CalibrationResult", /./],
  ["names", "vision_msgs/msg/LabelInfo", /(^|\/)label_info$/],
  ["drive", "nav_msgs/msg/Path", /(^|\/)path$/],
  ["loops", "visualization_msgs/msg/MarkerArray", /(^|\/)loop_closures$/],
  ["centers", "sensor_msgs/msg/PointCloud2", /map_centers$/],
  ["cloud", "sensor_msgs/msg/PointCloud2", /./],
];

function kindOf(channel) {
  const found = KINDS.find(([, type, topic]) => type === channel.schemaName && topic.test(channel.topic));
  return found ? found[0] : null;
}

function connect() {
  const address = new URL("/", self.location.href);
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address, PROTOCOLS);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => {
    try {
      if (typeof event.data === "string") onText(JSON.parse(event.data));
      else onData(new Uint8Array(event.data));
    } catch (error) {
      postMessage({ type: "problem", text: `${error.name}: ${error.message}` });
    }
  };
  socket.onclose = () => {
    postMessage({ type: "closed" });
    subscriptions.clear();
    setTimeout(connect, retry);
    retry = Math.min(2000, retry * 2);
  };
}

function onText(message) {
  if (calls.takeText(message)) return;
  if (message.op === "serverInfo") {
    retry = 250;
    calls.connected();
    if (session !== message.sessionId) {
      session = message.sessionId;
      // A restarted server: the previous state is invalid once its map arrives.
      follower.info = null;
    }
    published = new Map();
    postMessage({ type: "open", session, file: message.metadata?.source === "file", thin: THIN !== "" });
    if (message.capabilities.includes("connectionGraph")) socket.send(JSON.stringify({ op: "subscribeConnectionGraph" }));
  } else if (message.op === "advertise") {
    channels = new Map(message.channels.map((channel) => [channel.id, { ...channel, kind: kindOf(channel) }]));
    for (const channel of channels.values()) if (isWanted(channel)) subscribe(channel);
    postMessage({ type: "channels", channels: [...channels.values()].map(({ id, topic, schemaName, kind }) => ({ id, topic, schemaName, kind })) });
  } else if (message.op === "connectionGraphUpdate") {
    for (const { name, publisherIds } of message.publishedTopics) published.set(name, publisherIds);
    for (const name of message.removedTopics) published.delete(name);
    postMessage({ type: "published", topics: [...published.keys()].filter((name) => published.get(name).length > 0) });
  } else if (message.op === "status") {
    postMessage({ type: "problem", text: message.message, told: true });
  }
}

const isWanted = (channel) => channel.kind && (wanted.has(channel.kind) || wanted.has(channel.topic));

function subscribe(channel) {
  const id = nextSubscription++;
  subscriptions.set(id, channel);
  socket.send(JSON.stringify({ op: "subscribe", subscriptions: [{ id, channelId: channel.id }] }));
}

function unsubscribe(unwanted) {
  for (const [id, channel] of subscriptions) {
    if (!unwanted(channel)) continue;
    subscriptions.delete(id);
    socket.send(JSON.stringify({ op: "unsubscribe", subscriptionIds: [id] }));
  }
}

// Requests the whole map again.
function renewMap() {
  const isMap = (channel) => channel.kind === "map";
  unsubscribe(isMap);
  for (const channel of channels.values()) if (isMap(channel)) subscribe(channel);
}

function onData(bytes) {
  if (calls.takeData(bytes)) return;
  if (bytes[0] !== MESSAGE_DATA || bytes.length < HEADER) return;
  const view = new DataView(bytes.buffer);
  const channel = subscriptions.get(view.getUint32(1, true));
  if (!channel) return;
  const stamp = Number(view.getBigUint64(5, true)) / 1e6;
  count(channel, bytes.length, Date.now() - stamp);
  const cdr = bytes.subarray(HEADER);
  switch (channel.kind) {
    case "map":
      onMap(messages.latticeMap(cdr));
      break;
    case "free":
      free.onMap(messages.latticeMap(cdr));
      break;
    case "updates": {
      const update = messages.latticeMapUpdate(cdr);
      if (!follower.onUpdate(update)) renewMap();
      changed = true;
      break;
    }
    case "static":
    case "tf":
      postMessage({ type: "transforms", transforms: messages.transforms(cdr), fixed: channel.kind === "static" });
      break;
    case "diagnostics":
    case "calibration":
    case "names":
    case "drive":
    case "loops":
      postMessage({ type: channel.kind, said: messages[channel.kind](cdr) });
      break;
    case "centers":
    case "cloud":
      postMessage({ type: "cloud", topic: channel.topic, cloud: messages.cloud(cdr) });
  }
}

function onMap(map) {
  follower.onMap(map);
  if (follower.renewed) {
    follower.renewed = false;
    const { info, frame } = follower;
    follower.rowOfHeight = heightRow(info);
    postMessage({ type: "lattice", frame, info: { ...info, epoch: info.epoch.toString() } });
  }
  changed = true;
}

// Row of the matrix from lattice indices to the map's z.
function heightRow({ generator: g, place: { rotation: [x, y, z, w] } }) {
  const row = [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)];
  return [0, 1, 2].map((k) => row[0] * g[k] + row[1] * g[3 + k] + row[2] * g[6 + k]);
}

function flush() {
  if (free.dirty.size > 0) flushFree();
  if (!changed) return;
  const tiles = follower.takeDirty(MOST_TILES);
  changed = follower.dirty.size > 0;
  const { size, sequence, staging } = follower;
  postMessage({
    type: "tiles",
    tiles,
    size,
    labels: [...follower.labelled],
    coloured: follower.coloured,
    earth: { hasOrigin: follower.info?.hasOrigin, origin: follower.info?.origin },
    now: follower.now(),
    sequence: sequence === null ? null : sequence.toString(),
    complete: sequence !== null && staging === null && !changed,
  }, tiles.map((tile) => tile.cells.buffer));
}

function flushFree() {
  const info = free.renewed ? { ...free.info, epoch: "" } : null;
  free.renewed = false;
  const tiles = free.takeDirty(MOST_TILES);
  postMessage({ type: "free", info, tiles, size: free.size }, tiles.map((tile) => tile.cells.buffer));
}

function count(channel, bytes, latency) {
  const rate = rates.get(channel.topic) ?? { messages: 0, bytes: 0, latency: 0 };
  rate.messages++;
  rate.bytes += bytes;
  rate.latency = Math.max(rate.latency, latency);
  rates.set(channel.topic, rate);
}

function tellRates() {
  postMessage({ type: "rates", rates: [...rates] });
  rates.clear();
}

self.onmessage = ({ data }) => {
  if (calls.ask(socket, data)) return;
  if (data.type === "want") {
    if (/(^|\/)free$/.test(data.topic)) free = new Follower();
    if (data.on) {
      wanted.add(data.topic);
      for (const channel of channels.values()) if (channel.topic === data.topic && socket.readyState === 1) subscribe(channel);
    } else {
      wanted.delete(data.topic);
      unsubscribe((channel) => channel.topic === data.topic);
    }
  } else if (data.type === "cell") {
    postMessage({ type: "cell", request: data.request, cell: follower.cell(data.tile, data.place) });
  } else if (data.type === "keys") {
    postMessage({ type: "keys", keys: follower.keys(), counts: follower.counts() });
  }
};

setInterval(flush, 100);
setInterval(tellRates, 1000);
connect();
