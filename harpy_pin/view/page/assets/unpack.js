"use strict";

// Bytes of base64 text.
function bytes_of(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
}

// The page's content: JSON, compressed.
async function unpack(text) {
  const stream = new Blob([bytes_of(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).json();
}

// An element with text, which is never read as markup.
function make(tag, text = "", name = "") {
  const element = document.createElement(tag);
  element.textContent = text;
  if (name) element.className = name;
  return element;
}

function find(id) {
  return document.getElementById(id);
}

// Times within this are one, s: the viewer keeps keyframes as 32-bit numbers.
const SAME = 1e-4;

// The last index whose value is not after x, in increasing values.
function row_at(values, x) {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= x + SAME) low = middle; else high = middle - 1;
  }
  return low;
}
