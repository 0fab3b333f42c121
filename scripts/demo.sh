#!/bin/sh
# The demo: a scripted robot picks cubes in four worlds at once and records it, and a picture shows what happened. Then
# every installed engine gets the same world, and a page shows how far they agree.
#   usage: scripts/demo.sh DIRECTORY    runs/demo, which `make demo` gives, is replaced; another one must be new
set -eu

out=${1:-runs/demo}
started=$(date +%s)
say() { printf '\ndemo: %s\n' "$*"; }
step() { say "$1"; shift; printf '$ %s\n' "$*"; "$@"; }

[ "$out" != runs/demo ] || rm -rf runs/demo
step "1 of 3: a robot picks cubes on MuJoCo, in four worlds at once" \
    .venv/bin/anysim run pick_cube --num-envs 4 --episodes 8 --seed 1 --out "$out"
step "2 of 3: a picture of what its cameras saw" \
    .venv/bin/python scripts/demo_picture.py "$out"
step "3 of 3: the same world, seeds and actions on every installed engine" \
    .venv/bin/anysim compare pick_cube --episodes 4 --seed 1 --out "$out/compare"

video=$(find "$out/episodes" -name '*.mp4' | sort | head -n 1)
say "done after $(($(date +%s) - started)) s. Open:"
printf '  %-52s %s\n' \
    "$out/demo.png" "what the cameras saw, a row each" \
    "$out/compare/compare.html" "how far the engines agree, and why not further" \
    "$video" "one episode as a film; beside it what was recorded"
printf 'Then: .venv/bin/anysim --help, and docs/README.md\n'
