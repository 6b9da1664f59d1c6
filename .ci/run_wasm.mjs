// Runs a WebAssembly program's main: it must need nothing from outside, and end without a trap.
import { readFile } from "node:fs/promises";

const { instance } = await WebAssembly.instantiate(await readFile(process.argv[2]), {});
const code = instance.exports.main(0, 0);
if (code !== 0) throw new Error(`main returned ${code}`);
console.log(`${process.argv[2]}: main returned 0`);
