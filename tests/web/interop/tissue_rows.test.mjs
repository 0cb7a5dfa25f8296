// SPDX-License-Identifier: Apache-2.0
// tissue_rows.test.mjs: rows that palpate_tissue writes as MCAP, in the hands of @mcap/core.
// $PALPATE_BIN names the folder of the programs; the library lies beside it.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const library = join(bin, "../physics_node/library/libpalpate_tissue.so");
const python = ["python3", "/usr/bin/python3"].find((one) => spawnSync(one, ["-c", "import numpy"]).status === 0);
const missing = !existsSync(library) ? `no ${library}: build palpate_tissue_c` : python ? false : "no Python with numpy";

const script = `
import sys
import numpy as np
import palpate_tissue as pt
n = 30000
rows = {"force": np.arange(6.0 * n).reshape(n, 2, 3), "error": np.where(np.arange(n) < 3, np.nan, 0.5)}
pt.rows.write_mcap(sys.argv[1], rows, 1e-3 * np.arange(n), {"policy": "scripted"})
`;

test("an independent reader seeks in the rows that palpate_tissue writes", { timeout: patience(60000), skip: missing }, async (t) => {
  const folder = mkdtempSync(join(tmpdir(), "palpate-rows-"));
  t.after(() => rmSync(folder, { recursive: true, force: true }));
  const file = join(folder, "rows.mcap");
  const env = { ...process.env, PALPATE_TISSUE_LIBRARY: library, PYTHONPATH: join(root, "physics_node/library/python"), PYTHONDONTWRITEBYTECODE: "1" };
  execFileSync(python, ["-c", script, file], { env });

  const data = readFileSync(file);
  const reader = await McapIndexedReader.Initialize({
    readable: { size: async () => BigInt(data.length), read: async (at, size) => new Uint8Array(data.subarray(Number(at), Number(at + size))) },
  });
  assert.equal(reader.statistics.messageCount, 60000n);
  assert.ok(reader.chunkIndexes.length > 2);
  const text = (bytes) => new TextDecoder().decode(bytes);
  const force = [...reader.channelsById.values()].find((channel) => channel.topic === "force");
  assert.equal(force.messageEncoding, "json");
  assert.equal(force.metadata.get("shape"), "[2, 3]");
  assert.equal(reader.schemasById.get(force.schemaId).encoding, "jsonschema");
  assert.deepEqual(JSON.parse(text(reader.schemasById.get(force.schemaId).data)).properties.value, { type: "array", items: { type: "number" } });

  const read = async (choice) => {
    const found = [];
    for await (const message of reader.readMessages({ validateCrcs: true, ...choice })) found.push([message.logTime, JSON.parse(text(message.data)).value]);
    return found;
  };
  const last = await read({ topics: ["force"], startTime: 29_998_000_000n });
  assert.deepEqual(last, [29998, 29999].map((i) => [BigInt(i) * 1_000_000n, [0, 1, 2, 3, 4, 5].map((k) => 6 * i + k)]));
  assert.deepEqual((await read({ topics: ["error"], endTime: 3_000_000n })).map(([, value]) => value), [null, null, null, 0.5]);
  for await (const metadata of reader.readMetadata()) assert.deepEqual([metadata.name, ...metadata.metadata], ["about", ["policy", "scripted"]]);

  const stream = new McapStreamReader({ validateCrcs: true });
  stream.append(data);
  let messages = 0;
  for (let record; (record = stream.nextRecord());) messages += record.type === "Message" ? 1 : 0;
  assert.equal(messages, 60000);
  assert.ok(stream.done());
});
