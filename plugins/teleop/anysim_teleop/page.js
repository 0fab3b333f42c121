"use strict";
// Sends the keys and sticks that are held thirty times a second, and shows what comes back.
const token = location.hash.slice(1);
const headers = { Authorization: "Bearer " + token };
const held = new Set();
let pressed = [];
let picture = 0;
let buttons = [];
const PAD = { 0: " ", 1: "x", 3: "t", 8: "Backspace", 9: "Enter", 12: "+", 13: "-", 14: "Tab", 15: "Tab" };
const show = (name, text) => { document.getElementById(name).textContent = text; };
const named = (event) => (event.key.length === 1 ? event.key.toLowerCase() : event.key);

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (!event.repeat) pressed.push(named(event));
  held.add(named(event));
});
addEventListener("keyup", (event) => held.delete(named(event)));
addEventListener("blur", () => held.clear());

function sticks() {
  const pad = [...navigator.getGamepads()].find((one) => one !== null);
  if (!pad) return [0, 0, 0, 0, 0, 0];
  const axis = (i) => (Math.abs(pad.axes[i] || 0) < 0.12 ? 0 : Math.max(-1, Math.min(1, pad.axes[i])));
  const button = (i) => (pad.buttons[i] ? pad.buttons[i].value : 0);
  for (const i in PAD) {
    const down = button(i) > 0.5;
    if (down && !buttons[i]) pressed.push(PAD[i]);
    buttons[i] = down;
  }
  return [-axis(1), -axis(0), -axis(3), button(5) - button(4), button(7) - button(6), -axis(2)];
}

async function exchange() {
  const body = JSON.stringify({ held: [...held].slice(0, 32), pressed: pressed.splice(0, 32), sticks: sticks() });
  const answer = await fetch("/input", { method: "POST", headers, body });
  if (!answer.ok) throw new Error(await answer.text());
  const state = await answer.json();
  show("line", state.line);
  show("told", state.told.join("\n"));
  if (state.picture === picture) return;
  picture = state.picture;
  const image = document.getElementById("picture");
  const old = image.src;
  image.src = URL.createObjectURL(await (await fetch("/picture", { headers })).blob());
  if (old) URL.revokeObjectURL(old);
}

async function run() {
  for (;;) {
    try {
      await exchange();
      show("trouble", "");
    } catch (error) {
      show("trouble", "no connection: " + error.message);
      await new Promise((go) => setTimeout(go, 500));
    }
    await new Promise((go) => setTimeout(go, 33));
  }
}
run();
