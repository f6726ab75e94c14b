// Numbers, angles and times as they are read on the page.

const MINUS = '\u2212';
const signed = (text) => text.replace('-', MINUS);

export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '—';
  return scientific(Number(value.toPrecision(digits)).toString());
}

function scientific(text) {
  const [mantissa, power] = text.split('e');
  if (power === undefined) return signed(mantissa);
  const raised = [...String(Number(power))].map((c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]);
  return `${signed(mantissa)} × 10${raised.join('')}`;
}

// Value and u, rounded to two significant digits of u.
export function withU(value, u, unit) {
  if (!Number.isFinite(value ?? NaN)) return '—';
  if (!(u > 0) || !Number.isFinite(u)) return `${number(value)} ${unit}`;
  const decimals = 1 - Math.floor(Math.log10(Number(u.toPrecision(2))));
  if (decimals > 9 || decimals < 0) return `${number(value)} ± ${number(u, 2)} ${unit}`;
  return `${signed(value.toFixed(decimals))} ± ${u.toFixed(decimals)} ${unit}`;
}

export function degrees(angle, decimals = 2) {
  if (angle === null || angle === undefined) return '—';
  return signed(`${Number(angle.toFixed(decimals)) + 0}°`);
}

export function percent(share) {
  return `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;
}

export function exposure(seconds) {
  return seconds < 1 ? `${number(1000 * seconds, 3)} ms` : `${number(seconds, 3)} s`;
}

export function duration(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 90) return `${whole} s`;
  const minutes = Math.round(whole / 60);
  if (minutes < 90) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, '0')} min`;
}

export function timeOfDay(utc) {
  const time = new Date(utc);
  return Number.isNaN(time.getTime()) ? utc : time.toLocaleTimeString('en-GB');
}

export function clockIn(seconds) {
  const end = new Date(Date.now() + 1000 * seconds);
  return end.toLocaleTimeString('en-GB', { hour: '2-digit', minute: '2-digit' });
}

export const count = (n, noun, nouns = `${noun}s`) => `${n} ${n === 1 ? noun : nouns}`;
