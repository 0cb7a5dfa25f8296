// SPDX-License-Identifier: Apache-2.0
// foxglove.ts: a client of the Foxglove WebSocket protocol, version 1, for protobuf channels. The
// schemas come with the channels, so nothing is generated. Reconnects automatically.
import {
  createFileRegistry, fromBinary, toBinary, create,
  type DescMessage, type FileRegistry, type Message,
} from "@bufbuild/protobuf";
import { FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";
import { base64Decode } from "@bufbuild/protobuf/wire";

export const kSubprotocols = ["foxglove.websocket.v1", "foxglove.sdk.v1"];
const kFirstRetry_ms = 250;
const kLastRetry_ms = 2000;
const kDataOpcode = 1;
const kDataHeaderBytes = 13; // opcode, uint32 subscription, uint64 time

interface Channel {
  id: number;
  topic: string;
  encoding: string;
  schemaName: string;
  schema: string;
  schemaEncoding?: string;
}
/** @param at_s  when the server sent the message, seconds since 1970 by its clock */
export type Handler = (message: never, at_s: number) => void;

interface Subscription {
  topic: string;
  schema: DescMessage;
  handler: Handler;
}
export interface ServerStatus {
  id?: string;
  level: number; // 0 information, 1 warning, 2 error
  message: string;
}

export interface Events {
  /** All channels of the server are known. */
  advertised(topics: string[]): void;
  opened(): void;
  closed(): void;
  server_info(info: { sessionId: string; capabilities: string[]; metadata: Record<string, string> }): void;
  status(status: ServerStatus): void;
}

/** Pages that lost their server together do not come back together: half to one and a half. */
export function with_jitter(delay_ms: number, random = Math.random()): number {
  return delay_ms * (0.5 + random);
}

export class FoxgloveClient {
  /** Unreadable frames: not of this protocol, or of another schema. */
  unreadable_count = 0;
  frame_count = 0;
  byte_count = 0;
  /** Time of the last message; page's clock, milliseconds. */
  heard_ms = -Infinity;

  private socket: WebSocket | null = null;
  private readonly subscriptions = new Map<number, Subscription>(); // by our own id
  private readonly subscription_of_channel = new Map<number, number>();
  private readonly channels = new Map<number, Channel>(); // advertised
  private readonly registries = new Map<string, FileRegistry>(); // by schema text
  private readonly published = new Map<string, { id: number; schema: DescMessage }>(); // by topic
  private next_id = 1;
  private retry_ms = kFirstRetry_ms;

  /** @param handler_of  a topic; topics without one are not subscribed to, see review() */
  constructor(
    private readonly url: string,
    private readonly handler_of: (topic: string) => Handler | undefined,
    private readonly events: Events) {
    this.connect();
  }

  get is_open(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes not yet handed to the network. */
  get unsent_bytes(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** False if nothing was sent: not connected, or the server advertises no such schema. */
  publish(topic: string, schema_name: string, fields: Record<string, unknown>): boolean {
    if (!this.is_open) return false;
    const channel = this.published.get(topic) ?? this.advertise(topic, schema_name);
    if (!channel) return false;
    const payload = toBinary(channel.schema, create(channel.schema, fields as never));
    const frame = new Uint8Array(5 + payload.length);
    frame[0] = kDataOpcode;
    new DataView(frame.buffer).setUint32(1, channel.id, true);
    frame.set(payload, 5);
    this.socket!.send(frame);
    return true;
  }

  private connect(): void {
    const socket = new WebSocket(this.url, kSubprotocols);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.retry_ms = kFirstRetry_ms;
      this.heard_ms = performance.now();
      this.events.opened();
    };
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      this.heard_ms = performance.now();
      try {
        if (typeof data === "string") this.take_text(data);
        else this.take_binary(data);
      } catch (error) {
        this.unreadable_count += 1;
        if (this.unreadable_count === 1) console.warn("unreadable frame:", error);
      }
    };
    socket.onclose = () => {
      this.socket = null;
      this.subscriptions.clear();
      this.subscription_of_channel.clear();
      this.channels.clear();
      this.published.clear();
      this.events.closed();
      setTimeout(() => this.connect(), with_jitter(this.retry_ms));
      this.retry_ms = Math.min(2 * this.retry_ms, kLastRetry_ms);
    };
    this.socket = socket;
  }

  private take_text(text: string): void {
    const message = JSON.parse(text);
    this.byte_count += text.length;
    switch (message.op) {
      case "serverInfo":
        this.events.server_info({ metadata: {}, capabilities: [], ...message });
        break;
      case "advertise":
        for (const channel of message.channels as Channel[]) this.channels.set(channel.id, channel);
        this.events.advertised([...this.channels.values()].map(({ topic }) => topic));
        this.review();
        break;
      case "unadvertise":
        for (const channel of message.channelIds as number[]) {
          this.channels.delete(channel);
          const id = this.subscription_of_channel.get(channel);
          if (id !== undefined) this.subscriptions.delete(id);
          this.subscription_of_channel.delete(channel);
        }
        break;
      case "status":
        this.events.status(message);
        break;
    }
  }

  private take_binary(data: ArrayBuffer): void {
    this.byte_count += data.byteLength;
    const view = new DataView(data);
    if (view.getUint8(0) !== kDataOpcode) return;
    const subscription = this.subscriptions.get(view.getUint32(1, true));
    if (!subscription) return;
    this.frame_count += 1;
    const message = fromBinary(subscription.schema, new Uint8Array(data, kDataHeaderBytes));
    subscription.handler(message as Message as never, 1e-9 * Number(view.getBigUint64(5, true)));
  }

  /** Subscribes to the topics that have a handler, and no longer to those that had one. */
  review(): void {
    if (!this.is_open) return;
    const requested: { id: number; channelId: number }[] = [];
    const ended: number[] = [];
    for (const channel of this.channels.values()) {
      const handler = this.handler_of(channel.topic);
      const known = this.subscription_of_channel.get(channel.id);
      if (known !== undefined && !handler) {
        ended.push(known);
        this.subscriptions.delete(known);
        this.subscription_of_channel.delete(channel.id);
      }
      if (channel.encoding !== "protobuf" || known !== undefined || !handler) continue;
      const schema = this.registry_of(channel).getMessage(channel.schemaName);
      if (!schema) continue;
      const id = this.next_id++;
      this.subscriptions.set(id, { topic: channel.topic, schema, handler });
      this.subscription_of_channel.set(channel.id, id);
      requested.push({ id, channelId: channel.id });
    }
    if (ended.length > 0) this.send_text({ op: "unsubscribe", subscriptionIds: ended });
    if (requested.length > 0) this.send_text({ op: "subscribe", subscriptions: requested });
  }

  private registry_of(channel: Channel): FileRegistry {
    let registry = this.registries.get(channel.schema);
    if (!registry) {
      registry = createFileRegistry(fromBinary(FileDescriptorSetSchema, base64Decode(channel.schema)));
      this.registries.set(channel.schema, registry);
    }
    return registry;
  }

  private advertise(topic: string, schema_name: string) {
    for (const registry of this.registries.values()) {
      const schema = registry.getMessage(schema_name);
      if (!schema) continue;
      const channel = { id: this.next_id++, schema };
      this.published.set(topic, channel);
      this.send_text({
        op: "advertise",
        channels: [{ id: channel.id, topic, encoding: "protobuf", schemaName: schema_name }],
      });
      return channel;
    }
    return undefined;
  }

  private send_text(message: object): void {
    this.socket!.send(JSON.stringify(message));
  }
}
