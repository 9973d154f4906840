// Recordings of the demonstration's rig, as large as a bar asks for.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { run } from "./workbench.mjs";

const DEMO = new URL("../../../rigs/demo-hdpe.toml", import.meta.url);

// The rig with so many of its pressure sensors and nothing else.
export function rig(folder, sensors) {
  const [head, ...rest] = readFileSync(DEMO, "utf8").split(/^(?=\[\[(?:sensor|device)\]\])/m);
  const pressures = rest.filter((part) => part.includes('kind = "pressure"')).slice(0, sensors);
  const path = join(folder, `rig-${sensors}.toml`);
  writeFileSync(path, [head, ...pressures, ...rest.filter((part) => part.startsWith("[[device]]"))].join(""));
  return path;
}

// A simulated test, recorded as fast as it goes.
export function recorded(program, folder, name, { sensors, rate, seconds, effects = "viscoelastic-wall:2", set = [] }) {
  const words = ["record", "--rig", rig(folder, sensors), "--simulate", "--speed", "0", "--rate", String(rate), "--duration", String(seconds)];
  run(program, folder, ...words, "--effects", effects, ...set.flatMap((value) => ["--set", value]), "-o", name);
  return name;
}
