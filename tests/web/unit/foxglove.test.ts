// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import test from "node:test";
import { create, toBinary } from "@bufbuild/protobuf";
import { DurationSchema, FileDescriptorSetSchema, TimestampSchema } from "@bufbuild/protobuf/wkt";
import { FoxgloveClient, with_jitter } from "../../../viewer_node/web/src/foxglove";

// The schemas of protobuf itself serve as well as ours.
const schema = (...descs: { file: { proto: unknown } }[]) => Buffer.from(
  toBinary(FileDescriptorSetSchema, create(FileDescriptorSetSchema, { file: descs.map(({ file }) => file.proto) } as never))).toString("base64");
const kBoth = schema(TimestampSchema, DurationSchema);

class FakeSocket {
  static readonly OPEN = 1;
  static newest: FakeSocket;
  static count = 0;
  readyState = 0;
  bufferedAmount = 0;
  sent: (string | Uint8Array)[] = [];
  onopen = () => {};
  onclose = () => {};
  onmessage = (_: { data: string | ArrayBuffer }) => {};

  constructor(readonly url: string, readonly protocols: string[]) {
    FakeSocket.newest = this;
    FakeSocket.count += 1;
  }
  send(data: string | Uint8Array) {
    this.sent.push(data);
  }
  open() {
    this.readyState = 1;
    this.onopen();
  }
  text(message: object) {
    this.onmessage({ data: JSON.stringify(message) });
  }
  data(subscription: number, payload: Uint8Array, opcode = 1) {
    const frame = new Uint8Array(13 + payload.length);
    frame[0] = opcode;
    new DataView(frame.buffer).setUint32(1, subscription, true);
    frame.set(payload, 13);
    this.onmessage({ data: frame.buffer });
  }
  get last_json() {
    return JSON.parse(this.sent.at(-1) as string);
  }
}

function client_of(topics: string[]) {
  globalThis.WebSocket = FakeSocket as never;
  console.warn = () => {};
  const taken: { topic: string; seconds: bigint }[] = [];
  const events: string[] = [];
  const client = new FoxgloveClient("ws://x/",
    (topic) => (topics.includes(topic) ? ({ seconds }: { seconds: bigint }) => taken.push({ topic, seconds }) : undefined),
    {
      advertised: () => {}, opened: () => events.push("opened"), closed: () => events.push("closed"),
      server_info: ({ capabilities }) => events.push(`info ${capabilities}`), status: ({ message }) => events.push(message),
    });
  FakeSocket.newest.open();
  return { client, socket: FakeSocket.newest, taken, events };
}
const channel = (id: number, topic: string, more = {}) =>
  ({ id, topic, encoding: "protobuf", schemaName: "google.protobuf.Timestamp", schema: kBoth, ...more });
const timestamp = (seconds: number) => toBinary(TimestampSchema, create(TimestampSchema, { seconds: BigInt(seconds) }));

test("after a review just the topics with a handler are subscribed to", () => {
  const topics = ["/a", "/left/b"];
  const { client, socket, taken } = client_of(topics);
  socket.text({ op: "advertise", channels: [channel(5, "/a"), channel(6, "/left/b"), channel(7, "/right/b")] });
  const [, left] = socket.last_json.subscriptions;
  topics.splice(0, 2, "/a", "/right/b");

  client.review();

  assert.deepEqual(JSON.parse(socket.sent.at(-2) as string), { op: "unsubscribe", subscriptionIds: [left.id] });
  const { op, subscriptions: [right, ...more] } = socket.last_json;
  assert.deepEqual({ op, channel: right.channelId, more }, { op: "subscribe", channel: 7, more: [] });
  socket.data(left.id, timestamp(1)); // was on its way
  socket.data(right.id, timestamp(2));
  assert.deepEqual(taken, [{ topic: "/right/b", seconds: 2n }]);
});

test("both names of the protocol are offered", () => {
  const { socket } = client_of([]);
  assert.deepEqual(socket.protocols, ["foxglove.websocket.v1", "foxglove.sdk.v1"]);
});

test("only known topics with a readable schema are subscribed to", () => {
  const { socket } = client_of(["/a", "/b", "/c"]);
  socket.text({ op: "advertise", channels: [channel(5, "/a"), channel(6, "/other"), channel(7, "/b", { encoding: "json" }), channel(8, "/c", { schemaName: "no.Such" })] });

  assert.equal(socket.last_json.op, "subscribe");
  assert.deepEqual(socket.last_json.subscriptions.map((s: { channelId: number }) => s.channelId), [5]);
});

test("data goes by the subscription’s number, not the channel’s", () => {
  const { socket, taken } = client_of(["/a", "/b"]);
  socket.text({ op: "advertise", channels: [channel(50, "/a"), channel(60, "/b")] });
  const [a, b] = socket.last_json.subscriptions.map((s: { id: number }) => s.id);

  socket.data(b, timestamp(2));
  socket.data(a, timestamp(1));
  socket.data(50, timestamp(9)); // nobody's
  socket.data(a, timestamp(9), 2); // another kind of frame

  assert.deepEqual(taken, [{ topic: "/b", seconds: 2n }, { topic: "/a", seconds: 1n }]);
});

test("frames that cannot be read are counted, and the next one is taken", () => {
  const { client, socket, taken } = client_of(["/a"]);
  socket.text({ op: "advertise", channels: [channel(1, "/a")] });
  const [{ id }] = socket.last_json.subscriptions;

  socket.onmessage({ data: "{" });
  socket.onmessage({ data: new ArrayBuffer(0) });
  socket.data(id, Uint8Array.of(0xff, 0xff));
  socket.text({ op: "somethingNew" });
  socket.data(id, timestamp(3));

  assert.equal(client.unreadable_count, 3);
  assert.deepEqual(taken, [{ topic: "/a", seconds: 3n }]);
});

test("a channel that is taken back is heard no more", () => {
  const { socket, taken } = client_of(["/a"]);
  socket.text({ op: "advertise", channels: [channel(1, "/a")] });
  const [{ id }] = socket.last_json.subscriptions;
  socket.text({ op: "unadvertise", channelIds: [1] });
  socket.data(id, timestamp(1));

  assert.deepEqual(taken, []);
});

test("it publishes what any of the server’s schemas describes, and says so once", () => {
  const { client, socket } = client_of(["/a"]);
  const publish = (seconds: bigint) => client.publish("/out", "google.protobuf.Duration", { seconds });
  assert.equal(publish(1n), false); // no schema yet
  socket.text({ op: "advertise", channels: [channel(1, "/a")] });
  const before = socket.sent.length;

  assert.ok(publish(5n) && publish(6n));

  const [advertise, first, second] = socket.sent.slice(before);
  const { channels } = JSON.parse(advertise as string);
  assert.deepEqual(channels[0], { id: channels[0].id, topic: "/out", encoding: "protobuf", schemaName: "google.protobuf.Duration" });
  assert.deepEqual([...first as Uint8Array], [1, channels[0].id, 0, 0, 0, 8, 5]);
  assert.deepEqual([...second as Uint8Array].slice(-2), [8, 6]);
});

test("a lost connection is made again, with the new channels", async () => {
  const { client, socket, taken, events } = client_of(["/a"]);
  socket.text({ op: "advertise", channels: [channel(1, "/a")] });
  const count = FakeSocket.count;
  socket.readyState = 3;
  socket.onclose();
  assert.equal(client.is_open, false);
  assert.equal(client.publish("/out", "google.protobuf.Duration", {}), false);

  while (FakeSocket.count === count) await new Promise((resolve) => setTimeout(resolve, 10));
  const again = FakeSocket.newest;
  again.open();
  again.text({ op: "advertise", channels: [channel(77, "/a")] });
  again.data(again.last_json.subscriptions[0].id, timestamp(4));

  assert.deepEqual(taken, [{ topic: "/a", seconds: 4n }]);
  assert.deepEqual(events, ["opened", "closed", "opened"]);
});

test("pages that lost their server together come back spread over as long as they wait", () => {
  assert.equal(with_jitter(1000, 0), 500);
  assert.equal(with_jitter(1000, 0.5), 1000);
  assert.ok(with_jitter(1000, 0.999) < 1500);
  const delays = Array.from({ length: 100 }, () => with_jitter(1000));
  assert.ok(Math.max(...delays) - Math.min(...delays) > 500, "all at once");
});
