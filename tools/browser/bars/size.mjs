// What the workbench adds to the binary and to a cold build: the present commit without it and with it, each built from nothing.
import { execFileSync } from "node:child_process";
import { readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";

// Where the workbench hangs in the program, and what only it depends on.
const LEAVES_OUT = {
  "src/lib.rs": [[/^pub mod web;$/m, ""]],
  "src/cli/mod.rs": [[/^ *Open\(.*$/m, ""], [/^ *Command::Open\(.*$/m, ""]],
  "src/cli/commands/mod.rs": [[/^pub mod open;$/m, ""]],
  "src/cli/commands/demo.rs": [[/^use crate::cli::commands::open;$/m, ""], [/return open::run\(.*\);/, "return Ok(Outcome::Done);"]],
  "Cargo.toml": [[/^(axum|hyper|hyper-util|futures-util|getrandom|base64) = .*\n/gm, ""]],
};

function leave_out(tree) {
  for (const [file, edits] of Object.entries(LEAVES_OUT)) {
    let text = readFileSync(join(tree, file), "utf8");
    for (const [what, instead] of edits) {
      if (text.search(what) < 0) throw new Error(`${file} has no ${what}: the workbench hangs elsewhere now`);
      text = text.replace(what, instead);
    }
    writeFileSync(join(tree, file), text);
  }
}

function built(repository, folder, with_it) {
  const tree = join(folder, "tree");
  const git = (...words) => execFileSync("git", ["-C", repository, ...words], { stdio: "ignore" });
  git("worktree", "add", "--detach", tree, "HEAD");
  try {
    if (!with_it) leave_out(tree);
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
  return { before: built(repository, folder, false), now: built(repository, folder, true) };
}
