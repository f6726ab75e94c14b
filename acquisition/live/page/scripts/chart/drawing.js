// What is drawn over the axes: lines of the model, error bars, symbols, flags, the selected point.
// A frame turns degrees and values into pixels of the canvas.

import { colour } from '../theme.js';
import { isFlagged } from './curves.js';
import { drawFlag, drawSymbol, FLAG_RADIUS, styleOf } from './symbols.js';

const PALE = 0.5; // opacity of a value that will change: its white tile is not read yet
const FLAG_REACH = FLAG_RADIUS + 2.5; // with its ring

// Radius of symbols in CSS pixels: smaller where many points stand side by side.
function radiusOf({ width, scale }, curves) {
  const most = Math.max(1, ...curves.map((curve) => curve.points.length));
  return Math.min(Math.max(width / scale / most / 2.2, 1.8), 4);
}

// `toX`, `toY`: pixels of a value; a point without value, or beyond the axis, stands at the edge.
export function frameOf(plot) {
  const { left, top, width, height } = plot.bbox;
  const scale = plot.bbox.width / plot.over.clientWidth || 1;
  const toX = (x) => plot.valToPos(x, 'x', true);
  const toY = (y) => plot.valToPos(y, 'y', true);
  const inside = (y) =>
    Math.min(Math.max(y, top + FLAG_REACH * scale), top + height - FLAG_REACH * scale);
  const placed = (point) => [
    toX(point.x_deg),
    inside(point.value === null ? Infinity : toY(point.value)),
  ];
  return { context: plot.ctx, left, top, width, height, scale, toX, toY, placed };
}

export function drawCurves(frame, curves, selected) {
  const { context } = frame;
  context.save();
  context.beginPath();
  context.rect(frame.left, frame.top, frame.width, frame.height);
  context.clip();
  const radius = radiusOf(frame, curves) * frame.scale;
  for (const curve of curves) drawCurve(frame, curve, radius);
  for (const curve of curves) drawFlags(frame, curve);
  if (selected?.kind === 'point') drawSelected(frame, selected);
  context.restore();
}

function drawCurve(frame, curve, radius) {
  const { context } = frame;
  const style = styleOf(curve.index);
  context.strokeStyle = style.colour;
  context.fillStyle = style.colour;
  if (curve.line) drawLine(frame, curve.line, style.dash);
  context.setLineDash([]);
  for (const point of curve.points.filter((p) => p.value !== null && !isFlagged(p))) {
    context.globalAlpha = point.provisional ? PALE : 1;
    drawBar(frame, point);
    drawSymbol(context, style.symbol, ...frame.placed(point), radius);
  }
  context.globalAlpha = 1;
}

function drawLine({ context, scale, toX, toY }, line, dash) {
  context.lineWidth = 1.5 * scale;
  context.setLineDash(dash.map((length) => length * scale));
  context.beginPath();
  line.x_deg.forEach((x, k) => context.lineTo(toX(x), toY(line.value[k])));
  context.stroke();
}

function drawBar({ context, scale, toX, toY }, point) {
  if (!(point.u > 0)) return;
  const [x, half] = [toX(point.x_deg), 3 * scale];
  context.lineWidth = 1.2 * scale;
  context.beginPath();
  context.moveTo(x, toY(point.value - point.u));
  context.lineTo(x, toY(point.value + point.u));
  for (const end of [point.value - point.u, point.value + point.u]) {
    context.moveTo(x - half, toY(end));
    context.lineTo(x + half, toY(end));
  }
  context.stroke();
}

// The ring around a flag has the colour of its curve.
function drawFlags({ context, scale, placed }, curve) {
  context.setLineDash([]);
  for (const point of curve.points.filter(isFlagged)) {
    const [x, y] = placed(point);
    context.fillStyle = styleOf(curve.index).colour;
    context.beginPath();
    context.arc(x, y, FLAG_REACH * scale, 0, 2 * Math.PI);
    context.fill();
    drawFlag(context, x, y, FLAG_RADIUS * scale);
  }
}

function drawSelected({ context, scale, top, height, placed }, point) {
  const [x, y] = placed(point);
  context.strokeStyle = colour('--ink');
  context.lineWidth = 2 * scale;
  context.beginPath();
  context.arc(x, y, 14 * scale, 0, 2 * Math.PI);
  context.stroke();
  context.lineWidth = scale;
  context.setLineDash([3 * scale, 4 * scale]);
  context.beginPath();
  context.moveTo(x, top);
  context.lineTo(x, y - 14 * scale);
  context.moveTo(x, y + 14 * scale);
  context.lineTo(x, top + height);
  context.stroke();
}
