// Symbols of curves and of flagged points, for the chart's canvas and for legends.

import { colour } from '../theme.js';

export const FLAG_RADIUS = 7.5; // CSS pixels
const CORNERS = {
  square: [4, 0.785],
  triangle: [3, -1.571],
  diamond: [4, 0],
  inverted: [3, 1.571],
  pentagon: [5, -1.571],
};
const SYMBOLS = ['circle', 'square', 'triangle', 'diamond', 'inverted', 'plus', 'pentagon'];
const DASHES = [[], [7, 3], [7, 3, 2, 3], [2, 3], [11, 3, 2, 3, 2, 3]];

export function styleOf(index) {
  return {
    colour: colour(`--curve-${index % 8}`),
    symbol: SYMBOLS[index % SYMBOLS.length],
    dash: DASHES[index % DASHES.length],
  };
}

export function drawSymbol(context, symbol, x, y, radius) {
  context.beginPath();
  if (symbol === 'circle') context.arc(x, y, radius, 0, 2 * Math.PI);
  else if (symbol === 'plus') plus(context, x, y, radius, radius / 3);
  else polygon(context, x, y, 1.25 * radius, ...CORNERS[symbol]);
  context.fill();
}

function polygon(context, x, y, radius, corners, first) {
  for (let k = 0; k < corners; k += 1) {
    const angle = first + (2 * Math.PI * k) / corners;
    context.lineTo(x + radius * Math.cos(angle), y + radius * Math.sin(angle));
  }
  context.closePath();
}

function plus(context, x, y, radius, half) {
  context.rect(x - radius, y - half, 2 * radius, 2 * half);
  context.rect(x - half, y - radius, 2 * half, 2 * radius);
}

// Flagged: a disc with a cross, larger than all symbols of curves and in no curve's colour.
export function drawFlag(context, x, y, radius) {
  const arm = 0.5 * radius;
  context.lineWidth = radius / 4;
  context.fillStyle = colour('--flag');
  context.strokeStyle = colour('--flag-ink');
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
  context.beginPath();
  for (const slope of [1, -1]) {
    context.moveTo(x - arm, y - slope * arm);
    context.lineTo(x + arm, y + slope * arm);
  }
  context.stroke();
}

// Small canvas beside a word: `draw(context)` in CSS pixels.
export function swatch(width, height, draw) {
  const scale = window.devicePixelRatio || 1;
  const canvas = Object.assign(document.createElement('canvas'), {
    width: width * scale,
    height: height * scale,
  });
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  canvas.setAttribute('aria-hidden', 'true');
  const context = canvas.getContext('2d');
  context.scale(scale, scale);
  draw(context);
  return canvas;
}

export const flagSwatch = () => swatch(18, 18, (context) => drawFlag(context, 9, 9, FLAG_RADIUS));
