// Draws the pattern pixel for pixel, or refuses and says which size is wanted; reports what is on screen.
"use strict";

const canvas = document.getElementById("pattern");
const message = document.getElementById("message");
const screenBox = document.getElementById("screen");
const PAUSE_MS = 150;
let devicePixels = null; // [columns, rows] of the viewport in the screen's own pixels
let shown = "";
let told = "";

new ResizeObserver(([entry]) => {
  const box = entry.devicePixelContentBoxSize?.[0];
  devicePixels = box
    ? [box.inlineSize, box.blockSize]
    : [Math.round(innerWidth * devicePixelRatio), Math.round(innerHeight * devicePixelRatio)];
}).observe(screenBox, { box: "device-pixel-content-box" });

const nextFrame = () => new Promise((resolve) => requestAnimationFrame(resolve));

async function digestOf(bytes) {
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function report(id, digest, reason) {
  const body = {
    id, digest, reason,
    width_px: devicePixels[0], height_px: devicePixels[1], device_pixel_ratio: devicePixelRatio,
  };
  const text = JSON.stringify(body);
  if (text === told) return;
  const answer = await fetch("report", {
    method: "POST", headers: { "content-type": "application/json" }, body: text,
  });
  if (answer.ok) told = text;
}

async function draw(frame) {
  const grey = new Uint8Array(await (await fetch(`frames/${frame.id}`)).arrayBuffer());
  canvas.width = frame.width_px;
  canvas.height = frame.height_px;
  canvas.style.width = `${frame.width_px / devicePixelRatio}px`;
  canvas.style.height = `${frame.height_px / devicePixelRatio}px`;
  const context = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
  const image = context.createImageData(frame.width_px, frame.height_px);
  const words = new Uint32Array(image.data.buffer);
  for (let i = 0; i < grey.length; i++) words[i] = 0xff000000 | (grey[i] * 0x010101);
  context.putImageData(image, 0, 0);
  message.hidden = true;
  canvas.hidden = false;
  // The first callback comes before this paint, the second after it: then it is on screen.
  await nextFrame();
  await nextFrame();
  const drawn = context.getImageData(0, 0, frame.width_px, frame.height_px).data;
  const back = new Uint8Array(grey.length);
  for (let i = 0; i < back.length; i++) back[i] = drawn[4 * i];
  shown = frame.id;
  await report(frame.id, await digestOf(back), "");
}

async function refuse(id, reason) {
  shown = "";
  canvas.hidden = true;
  message.hidden = false;
  message.textContent = reason;
  if (id && devicePixels) await report(id, "", reason);
}

async function look() {
  const frame = await (await fetch("frame", { cache: "no-store" })).json();
  if (!devicePixels) return;
  const [columns, rows] = devicePixels;
  if (!frame.id) return refuse("", "Waiting for a pattern.");
  if (!crypto.subtle) return refuse(frame.id, "Open this page by https or as 127.0.0.1: it must be able to hash.");
  if (columns !== frame.width_px || rows !== frame.height_px) {
    return refuse(frame.id,
      `This window has ${columns} x ${rows} screen pixels; the pattern needs ${frame.width_px} x ` +
      `${frame.height_px}. Move it to the projector, set that to its native size, and make it full screen (F11).`);
  }
  if (document.visibilityState !== "visible") return refuse(frame.id, "This window is hidden; bring it to the front.");
  if (shown !== frame.id) await draw(frame);
}

async function loop() {
  try {
    await look();
  } catch {
    shown = told = ""; // the service restarted, or is gone: draw and report anew when it is back
  }
  setTimeout(loop, PAUSE_MS);
}

loop();
