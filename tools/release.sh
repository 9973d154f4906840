#!/usr/bin/env bash
# Builds the program as it is packaged, and packs it with manual pages, completions and licences:
#
#     tools/release.sh [FOLDER]
#
# makes surgescope-VERSION-TARGET.tar.gz, surgescope.deb where cargo-deb is installed, and SHA256SUMS in FOLDER (`dist` unless it is named). Needs
# Python 3 and GNU tar.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-dist}

target=$(rustc --print host-tuple)
id=$(cargo pkgid --package surgescope)
version=${id##*[#@]}
name=surgescope-$version-$target

# No path of this machine goes into the program.
export RUSTFLAGS="--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo --remap-path-prefix=$PWD=surgescope"
cargo build --locked --profile dist --package surgescope
program=target/dist/surgescope

rm -rf target/man target/completions
"$program" man target/man
mkdir -p target/completions
"$program" completions bash >target/completions/surgescope.bash
"$program" completions zsh >target/completions/_surgescope
"$program" completions fish >target/completions/surgescope.fish
python3 tools/third_party.py >target/third-party-licences.txt

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/$name"
cp -r "$program" target/man target/completions README.md CHANGELOG.md CITATION.cff LICENSE target/third-party-licences.txt "$work/$name"

# The same commit gives the same archive: times are the commit's, names are in order, and nobody owns anything.
mkdir -p "$out"
tar --directory "$work" --create --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$(git log -1 --format=%ct)" "$name" |
  gzip --no-name --best >"$out/$name.tar.gz"
packed=("$name.tar.gz")

# With the units of a rig computer. `cargo install cargo-deb` gets what makes it.
if cargo deb --version >/dev/null 2>&1; then
  cargo deb --quiet --locked --profile dist --no-build --output "$out/surgescope.deb"
  packed+=(surgescope.deb)
fi
(cd "$out" && sha256sum "${packed[@]}" >SHA256SUMS)

# What was packed runs.
tar --directory "$work" --extract --file "$out/$name.tar.gz" --one-top-level=check
[[ $("$work/check/$name/surgescope" --version) == "surgescope $version" ]]
echo "$out/$name.tar.gz"
