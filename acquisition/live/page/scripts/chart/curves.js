// Curves from points: grouping, ranges, the point beside another. No drawing.

// One curve for each incidence, in the order of the plan: {name, index, points along x, line}.
export function curvesOf(scan) {
  const byName = new Map();
  for (const point of scan.inOrder.filter((p) => p.kind === 'point')) {
    if (!byName.has(point.curve)) byName.set(point.curve, []);
    byName.get(point.curve).push(point);
  }
  const lines = new Map((scan.model?.lines ?? []).map((line) => [line.curve, line]));
  return [...byName].map(([name, points], index) => ({
    name,
    index,
    line: lines.get(name) ?? null,
    points: points.sort((a, b) => a.x_deg - b.x_deg),
  }));
}

export const isFlagged = (point) => point.flags.length > 0;

export function xRange(scan, curves) {
  const measured = curves.flatMap((curve) => curve.points.map((point) => point.x_deg));
  const [low, high] = spread([...(scan.run?.range_deg ?? []), ...measured], [-90, 90]);
  const margin = 0.03 * (high - low) || 1;
  return [low - margin, high + margin];
}

// Range of the values with their bars. Flagged points may lie anywhere: they do not count unless
// there is nothing else, and are drawn at the edge where they lie outside.
export function yRange(curves) {
  const points = curves.flatMap((curve) => curve.points).filter((p) => p.value !== null);
  const good = points.filter((point) => !isFlagged(point));
  const ends = (good.length ? good : points).flatMap((p) => [
    p.value - (p.u ?? 0),
    p.value + (p.u ?? 0),
  ]);
  const modelled = good.length ? curves.flatMap((curve) => curve.line?.value ?? []) : [];
  const [low, high] = spread([...ends, ...modelled.filter(Number.isFinite)], [0, 1]);
  const margin = 0.08 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low >= 0 && low < 0.4 * high ? 0 : low - margin, high + margin];
}

function spread(values, otherwise) {
  return values.length ? [least(values, Math.min), least(values, Math.max)] : otherwise;
}
const least = (values, pick) => values.reduce((a, b) => pick(a, b));

// Step of the point `along` places on in its curve, or nearest to it in the curve `across` places on.
export function neighbour(curves, step, along, across) {
  if (!curves.length) return null;
  const row = curves.findIndex((curve) => curve.points.some((p) => p.step === step));
  if (row < 0) return newest(curves).step;
  const { points } = curves[row];
  const place = points.findIndex((p) => p.step === step);
  if (across) {
    const other = curves[(row + across + curves.length) % curves.length].points;
    return nearest(other, (p) => Math.abs(p.x_deg - points[place].x_deg)).step;
  }
  return points[Math.min(Math.max(place + along, 0), points.length - 1)].step;
}

const newest = (curves) =>
  nearest(
    curves.flatMap((c) => c.points),
    (p) => -p.step,
  );

export function nearest(points, distance) {
  return points.reduce((a, b) => (distance(b) < distance(a) ? b : a));
}
