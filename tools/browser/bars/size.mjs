// What the workbench adds to the binary and to a cold build: the commit before it, and the present one, each built from nothing.
import { execFileSync } from "node:child_process";
import { rmSync, statSync } from "node:fs";
import { join } from "node:path";

const BEFORE = "b0fcd3b^";

function built(repository, commit, folder) {
  const tree = join(folder, "tree");
  const git = (...words) => execFileSync("git", ["-C", repository, ...words], { stdio: "ignore" });
  git("worktree", "add", "--detach", tree, commit);
  try {
    const target = join(folder, "target");
    rmSync(target, { recursive: true, force: true });
    const from = performance.now();
    execFileSync("cargo", ["build", "--release"], { cwd: tree, stdio: "ignore", env: { ...process.env, CARGO_TARGET_DIR: target } });
    return { seconds: (performance.now() - from) / 1000, bytes: statSync(join(target, "release", "surgescope")).size };
  } finally {
    git("worktree", "remove", "--force", tree);
  }
}

export function size(folder) {
  const repository = new URL("../../..", import.meta.url).pathname;
  return { before: built(repository, BEFORE, folder), now: built(repository, "HEAD", folder) };
}
