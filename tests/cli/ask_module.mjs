// Asks the explorer's module, without a page: `node ask_module.mjs MODULE.wasm.gz REQUESTS.json` prints the answers.
import { readFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";

const module = gunzipSync(readFileSync(process.argv[2]));
const paths = module.toString("latin1").match(/\/(home|root|Users|builds?|work|tmp)\/[\w.-]+/);
if (paths) throw new Error(`the module names a path of the machine that built it: ${paths[0]}`);
const { instance } = await WebAssembly.instantiate(module, {});
const { memory, room, answer, answered } = instance.exports;
const ask = (request) => {
  const text = new TextEncoder().encode(JSON.stringify(request));
  const at = room(text.length);
  new Uint8Array(memory.buffer, at, text.length).set(text);
  const length = answer();
  return JSON.parse(new TextDecoder().decode(new Uint8Array(memory.buffer, answered(), length)));
};
console.log(JSON.stringify(JSON.parse(readFileSync(process.argv[3], "utf8")).map(ask)));
