// SPDX-License-Identifier: Apache-2.0
// node foxglove_client.mjs RELIEVO_SERVER: Foxglove's own client reads a live stream from the gateway, and its own CDR
// reader decodes the frames by the schema that came with them. Run in a DDS domain of its own (in_own_domain). Exit 77:
// the client is not installed.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";

let FoxgloveClient, WebSocket;
try {
  ({ FoxgloveClient } = (await import("@foxglove/ws-protocol")).default ?? (await import("@foxglove/ws-protocol")));
  ({ WebSocket } = await import("ws"));
} catch (error) {
  console.log(`SKIP ${error.message}: run npm ci --prefix tests/e2e/mcap_js`);
  process.exit(77);
}

const kFrames = 5;
const server = spawn(
  process.argv[2],
  ["serve", "--source", "sim:plane,width=160,height=120,stripes=30", "--web", "127.0.0.1:0", "--stream", "plane",
    "--domain", process.env.RELIEVO_TEST_DOMAIN, "--interface", "lo"],
  { stdio: ["ignore", "pipe", "inherit"] },
);
const ended = new Promise((resolve) => server.once("exit", resolve));
try {
  const address = await new Promise((resolve, reject) => {
    let said = "";
    server.stdout.on("data", (data) => {
      said += data;
      const found = /viewer http:\/\/(\S+)\//.exec(said);
      if (found) resolve(found[1]);
    });
    ended.then((code) => reject(new Error(`the server ended with ${code}`)));
  });
  // The newer name, which Foxglove's application and its SDK speak now, is the same protocol.
  for (const name of [FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]) await read(address, name);
} finally {
  server.kill("SIGTERM");
  await ended;
}
process.exit(0);

async function read(address, subprotocol) {
  const client = new FoxgloveClient({ ws: new WebSocket(`ws://${address}/foxglove`, [subprotocol]) });
  const frames = await new Promise((resolve, reject) => {
    const got = [];
    let reader;
    client.on("error", reject);
    client.on("status", (status) => reject(new Error(status.message)));
    client.on("advertise", (channels) => {
      const channel = channels.find((one) => one.topic === "relievo/frame/plane");
      assert.ok(channel, JSON.stringify(channels.map((one) => one.topic)));
      assert.equal(channel.encoding, "cdr");
      assert.equal(channel.schemaEncoding, "omgidl");
      reader = new MessageReader(channel.schemaName, parseIDL(channel.schema));
      client.subscribe(channel.id);
    });
    client.on("message", (event) => {
      got.push({ time: event.timestamp, frame: reader.readMessage(event.data) });
      if (got.length === kFrames) resolve(got);
    });
  });
  client.close();
  frames.forEach(({ time, frame }, i) => {
    assert.equal(frame.stream, "plane");
    assert.equal(frame.capture_time_ns, time);
    assert.ok(frame.data.byteLength > 100, `${frame.data.byteLength} bytes`);
    if (i > 0) assert.ok(frame.sequence_number > frames[i - 1].frame.sequence_number);
  });
  console.log(`${kFrames} frames read by @foxglove/ws-protocol as ${subprotocol} and decoded by their schema`);
}
