// SPDX-License-Identifier: Apache-2.0
// stations.test.mjs: the page of `palpate stations`, in a real browser, of stations that answer, change and end.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import { kSkipScreenshots, launch, open, screenshot, violations } from "./support/browser.mjs";
import { patience } from "./support/machine.mjs";

const bin = process.env.PALPATE_BIN ?? fileURLToPath(new URL("../../build/release/bin", import.meta.url));
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate_tools")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

let browser;
before(async () => { if (!kLimit.skip) browser = await launch(); });
after(async () => { await browser?.close(); });

// longer than a terminal's line has room for
const kResult = `You got through <b>ligamentum flavum</b>. The tip went 3 mm behind ${"it ".repeat(20)}and no further.`;

/** A viewer_node, as far as it is asked. */
async function station(task) {
  const made = { task };
  made.server = createServer((_, answer) => answer.end(JSON.stringify({ session: "x", task: made.task }))).listen(0, "127.0.0.1");
  await once(made.server, "listening");
  made.url = `http://127.0.0.1:${made.server.address().port}/`;
  return made;
}

test("a teacher's page tells of each station, and follows it", kLimit, async () => {
  const anna = await station({ phase: "running", elapsed_s: 12, marks: 1, findings: [] });
  const ben = await station({ phase: "ended", elapsed_s: 61.4, marks: 2, findings: ["0.2 % of the measurements are missing: the score covers the rest.", kResult], score: { coverage_ratio: 0.934, missing_ratio: 0.002, force: { most_n: 2.125 } } });
  const carl = await station({ phase: 3 });
  const program = spawn(join(bin, "palpate"), ["stations", "--web-port", "0", `anna=${anna.url}`, `ben=${ben.url}`, `carl=${carl.url}`, "gone=http://127.0.0.1:1/"], { stdio: ["ignore", "pipe", "inherit"] });
  try {
    program.stdout.setEncoding("utf8");
    const [first] = await once(program.stdout, "data");
    const url = first.split("\n")[0];
    for (const dark of [false, true]) {
      const page = await open(browser, url, { width: 390, height: 844, dark, wait: false });
      const cells = (row) => page.locator("#stations tr").nth(row).locator("td").allTextContents();
      await page.locator("#stations tr").nth(3).waitFor();
      assert.deepEqual(await page.locator("#stations th").allTextContents(), ["anna", "ben", "carl", "gone"]);
      assert.deepEqual((await cells(0)).slice(0, 3), [dark ? "ended" : "running", "12", "1"]);
      assert.deepEqual(await cells(1), ["ended", "61", "2", "93", "2.12", "0.2", kResult]);
      assert.deepEqual(await cells(2), ["not understood", "", "", "", "", "", "phase is no word"]);
      assert.equal((await cells(3))[0], "absent");
      assert.match((await cells(3))[6], /cannot be reached/);
      assert.deepEqual(page.problems, []);
      assert.deepEqual(await violations(page), []);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, "the table scrolls, not the page");
      if (!dark) {
        anna.task.phase = "ended";
        await page.getByText("4 stations: 2 ended, 1 not understood, 1 absent").waitFor();
      } else {
        program.kill("SIGTERM");
        await once(program, "exit");
        await page.getByText("palpate stations has ended").waitFor();
      }
      assert.ok(page.requests.every((request) => request.startsWith(url)), `${page.requests}`);
      await page.context().close();
    }
  } finally {
    program.kill("SIGTERM");
    anna.server.close();
    ben.server.close();
    carl.server.close();
  }
});

test("screenshot of a teacher's page", { ...kLimit, skip: kLimit.skip || kSkipScreenshots }, async () => {
  const stations = {
    anna: await station({ phase: "running", elapsed_s: 72, marks: 1, findings: [] }),
    ben: await station({ phase: "ended", elapsed_s: 61.4, marks: 2, findings: ["Found 1 of 1."], score: { coverage_ratio: 0.934, missing_ratio: 0, force: { most_n: 2.125 } } }),
    carl: await station({ phase: "ended", elapsed_s: 180, marks: 0, findings: ["Found 0 of 1."], score: { coverage_ratio: 0.418, missing_ratio: 0, force: { most_n: 0.62 } } }),
    dora: await station({ phase: "waiting", elapsed_s: 0, marks: 0, findings: [] }),
  };
  const program = spawn(join(bin, "palpate"), ["stations", "--web-port", "0", ...Object.entries(stations).map(([name, { url }]) => `${name}=${url}`), "eva=http://127.0.0.1:1/"], { stdio: ["ignore", "pipe", "inherit"] });
  try {
    program.stdout.setEncoding("utf8");
    const [first] = await once(program.stdout, "data");
    const page = await open(browser, first.split("\n")[0], { width: 960, height: 340, scale: 1, wait: false });
    await page.locator("#stations tr").nth(4).waitFor();
    await screenshot(page, "stations");
  } finally {
    program.kill("SIGTERM");
    for (const { server } of Object.values(stations)) server.close();
  }
});
