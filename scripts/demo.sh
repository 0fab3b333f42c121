#!/bin/sh
# The demo: a scripted robot picks cubes in four worlds at once and records it, and a picture shows what happened. Others
# open a drawer, plug a charger in and hand a bar over. Then every installed engine gets the same world, and a page shows
# how far they agree.
#   usage: scripts/demo.sh DIRECTORY    runs/demo, which `make demo` gives, is replaced; another one must be new
set -eu

out=${1:-runs/demo}
started=$(date +%s)
say() { printf '\ndemo: %s\n' "$*"; }
step() { say "$1"; shift; printf '$ %s\n' "$*"; "$@"; }

[ "$out" != runs/demo ] || rm -rf runs/demo
# A camera that sees the whole robot, and shadows: what is drawn is for people here, and the task stays as it is.
step "1 of 4: a robot picks cubes on MuJoCo, in four worlds at once" \
    .venv/bin/anysim run pick_cube --num-envs 4 --episodes 8 --seed 1 --out "$out" \
    -o 'world.cameras.front={from: [1.45, -1.1, 1.25], look_at: [0.2, 0.0, 0.72], fov: 38, size: [480, 360]}' \
    -o world.scenery.shadows=true
step "2 of 4: a picture and a film of what its cameras saw; the pink disc is the goal" \
    .venv/bin/python scripts/demo_picture.py "$out"
step "3 of 4: tasks of other kinds, an episode each: a drawer, a plug, two arms" \
    .venv/bin/anysim run open_drawer plug_charger handover --num-envs 1 --episodes 3 --seed 1 --out "$out/more" \
    -o 'record.cameras=[front]' -o record.fps=10 -o world.scenery.shadows=true
.venv/bin/python scripts/demo_picture.py "$out/more"
step "4 of 4: the same world, seeds and actions on every installed engine" \
    .venv/bin/anysim compare pick_cube --episodes 4 --seed 1 --out "$out/compare"

say "done after $(($(date +%s) - started)) s. Open:"
printf '  %-52s %s\n' \
    "$out/demo.gif" "four worlds side by side, as a film" \
    "$out/demo.png" "what the cameras saw, a row each; the pink disc is the goal" \
    "$out/more/demo.gif" "a drawer, a plug and two arms" \
    "$out/compare/compare.html" "how far the engines agree, and what they declare" \
    "$out/episodes/" "a folder for each success: its videos, states and manifest"
printf '\nNext, each in a minute or less:\n'
printf '  %s\n      %s\n' \
    ".venv/bin/anysim replay $out" "rebuild every episode from its manifest, and compare every bit" \
    ".venv/bin/anysim snapshot take $out moment.snapshot --step 40" "a moment to go on from" \
    ".venv/bin/anysim picture docs/worlds/kitchen.yaml" "a furnished kitchen, on each engine" \
    ".venv/bin/anysim explain pick_cube --seed 1" "what was drawn in an episode, and from which line"
printf 'Then read docs/write_a_world.md, and write your own.\n'
