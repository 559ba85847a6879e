// Requests to nodes, in the worker: service calls and parameters over the socket.

const CALL = 2;
const RESPONSE = 3;
const MESSAGE_DATA = 1;
const CDR = new TextEncoder().encode("cdr");

// Handles text messages of services and parameters; true if handled.
export function takeText(message) {
  if (message.op === "advertiseServices") {
    postMessage({ type: "services", services: message.services.map(({ id, name, type }) => ({ id, name, kind: type })) });
  } else if (message.op === "serviceCallFailure") {
    postMessage({ type: "answer", call: message.callId, error: message.message });
  } else if (message.op === "parameterValues") {
    postMessage({ type: "parameters", parameters: message.parameters });
  } else return false;
  return true;
}

// Handles a service response; true if it is one.
export function takeData(bytes) {
  if (bytes[0] !== RESPONSE || bytes.length < 13) return false;
  const view = new DataView(bytes.buffer);
  const at = 13 + view.getUint32(9, true);
  postMessage({ type: "answer", call: view.getUint32(5, true), bytes: bytes.slice(at) });
  return true;
}

// Topics of this connection that the page publishes, with their channel ids.
const published = new Map();

// Begins a connection: its topics are advertised again.
export function connected() {
  published.clear();
}

// Publishes a CDR message on a headset topic.
function publish(socket, { topic, schemaName, bytes }) {
  if (!published.has(topic)) {
    published.set(topic, published.size + 1);
    send(socket, JSON.stringify({ op: "advertise", channels: [{ id: published.get(topic), topic, encoding: "cdr", schemaName }] }));
  }
  const message = new Uint8Array(5 + bytes.length);
  message[0] = MESSAGE_DATA;
  new DataView(message.buffer).setUint32(1, published.get(topic), true);
  message.set(bytes, 5);
  send(socket, message);
}

// Sends a request of the page; true if it is one.
export function ask(socket, data) {
  if (data.type === "call") {
    const bytes = new Uint8Array(13 + CDR.length + data.request.length);
    const view = new DataView(bytes.buffer);
    bytes[0] = CALL;
    [data.service, data.call, CDR.length].forEach((number, i) => view.setUint32(1 + 4 * i, number, true));
    bytes.set(CDR, 13);
    bytes.set(data.request, 13 + CDR.length);
    send(socket, bytes);
  } else if (data.type === "publish") {
    publish(socket, data);
  } else if (data.type === "get") {
    send(socket, JSON.stringify({ op: "getParameters", parameterNames: [] }));
  } else if (data.type === "set") {
    send(socket, JSON.stringify({ op: "setParameters", parameters: [data.parameter], id: data.parameter.name }));
  } else return false;
  return true;
}

function send(socket, message) {
  if (socket.readyState === 1) socket.send(message);
}
