// The graph of nodes by the protocol's own client: prints each message of it as a line of JSON.
// node foxglove_graph.mjs URL

import foxglove from "@foxglove/ws-protocol";
import WebSocket from "ws";

const socket = new WebSocket(process.argv[2], [foxglove.FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
const client = new foxglove.FoxgloveClient({ ws: socket });

function fail(error) {
  console.error(error);
  process.exit(1);
}

client.on("error", fail);
client.on("status", (status) => fail(status.message));
client.on("serverInfo", ({ capabilities }) => {
  if (!capabilities.includes("connectionGraph")) fail("not offered");
  client.subscribeConnectionGraph();
});
client.on("connectionGraphUpdate", (update) => console.log(JSON.stringify(update)));
