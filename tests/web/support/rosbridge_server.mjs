// SPDX-License-Identifier: Apache-2.0
// rosbridge_server.mjs: a rosbridge server without ROS: what clients advertise and publish goes to those
// that subscribe. As rosbridge_suite does, it refuses a field that the public definition of the type
// does not have, or of another type, with an error status, and writes null for what is no number.
import { once } from "node:events";
import { ros2humble } from "@foxglove/rosmsg-msgs-common";
import { WebSocketServer } from "ws";

const numbers = new Set(["int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"]);
// of the definitions above only those of ROS itself are known
const definitions = { ...ros2humble, "crtk_msgs/OperatingState": { definitions: [
  { type: "std_msgs/Header", name: "header", isComplex: true }, { type: "string", name: "state" },
  { type: "bool", name: "is_homed" }, { type: "bool", name: "is_busy" }] } };
const definition_of = (type) => definitions[type.replace("/msg/", "/")]?.definitions;

/** What is wrong with a value; undefined: nothing. */
function fault_of(value, field, where) {
  if (field.isArray) {
    if (!Array.isArray(value)) return `${where} is no array`;
    return value.map((one, i) => fault_of(one, { ...field, isArray: false }, `${where}[${i}]`)).find(Boolean);
  }
  if (field.type === "time" || field.type === "duration" || field.type.startsWith("builtin_interfaces/")) {
    return Number.isInteger(value?.sec) && Number.isInteger(value?.nanosec) && Object.keys(value).length === 2 ? undefined : `${where} is no time`;
  }
  if (numbers.has(field.type)) return typeof value === "number" ? undefined : `${where} is no number`;
  if (field.type === "string") return typeof value === "string" ? undefined : `${where} is no string`;
  if (field.type === "bool") return typeof value === "boolean" ? undefined : `${where} is no boolean`;
  return object_fault(value, field.type, where);
}
function object_fault(value, type, where) {
  const fields = definition_of(type)?.filter((field) => !field.isConstant);
  if (!fields) return `${where}: ${type} is unknown`;
  if (typeof value !== "object" || value === null) return `${where} is no object`;
  for (const [key, one] of Object.entries(value)) {
    const field = fields.find(({ name }) => name === key);
    if (!field) return `${where}.${key} is not in ${type}`;
    const fault = fault_of(one, field, `${where}.${key}`);
    if (fault) return fault;
  }
  return undefined;
}

export class RosbridgeServer {
  static async listen(port = 0) {
    const server = new RosbridgeServer();
    server.sockets = new WebSocketServer({ host: "127.0.0.1", port, maxPayload: 10_000_000 });
    await once(server.sockets, "listening");
    server.port = server.sockets.address().port;
    server.sockets.on("connection", (socket) => server.serve(socket));
    return server;
  }

  constructor() {
    this.types = new Map();       // by topic
    this.subscribers = new Map(); // sockets by topic
    this.kept = new Map();        // newest messages of topics that keep them
    this.faults = [];             // what was told to clients
    this.work_ms = 0;             // for each message that is passed on
  }

  serve(socket) {
    const advertised = new Set();
    const say = (msg) => { this.faults.push(msg); socket.send(JSON.stringify({ op: "status", level: "error", msg })); };
    socket.on("close", () => { for (const sockets of this.subscribers.values()) sockets.delete(socket); });
    socket.on("message", (data) => {
      const { op, topic, type, latch, msg } = JSON.parse(data);
      if (op === "advertise" || op === "subscribe") {
        if (!definition_of(type)) return say(`type ${type} of ${topic} is unknown`);
        const known = this.types.get(topic) ?? type;
        if (known !== type) return say(`${topic} is ${known}, not ${type}`);
        this.types.set(topic, type);
      }
      if (op === "advertise") {
        advertised.add(topic);
        if (latch) this.kept.set(topic, []);
      } else if (op === "subscribe") {
        if (!this.subscribers.has(topic)) this.subscribers.set(topic, new Set());
        this.subscribers.get(topic).add(socket);
        for (const text of this.kept.get(topic) ?? []) socket.send(text);
      } else if (op === "publish") {
        if (!advertised.has(topic)) return say(`${topic} is not advertised`);
        for (const end = performance.now() + this.work_ms; performance.now() < end;); // nothing else is read
        const fault = object_fault(msg, this.types.get(topic), topic);
        if (fault) return say(fault);
        this.tell(topic, msg);
      }
      return undefined;
    });
  }

  /** To those that subscribe; as a node of ROS does, also what no client could send. */
  tell(topic, msg) {
    const text = JSON.stringify({ op: "publish", topic, msg });
    this.kept.get(topic)?.push(text);
    for (const socket of this.subscribers.get(topic) ?? []) socket.send(text);
  }

  async close() {
    for (const socket of this.sockets.clients) socket.terminate();
    this.sockets.close();
    await once(this.sockets, "close");
  }
}
