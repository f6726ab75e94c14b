// Dark, light or red: as chosen on the page, or else as the computer prefers.
// The choice is kept in a cookie, which the pages of all scans share: storage belongs to one port.

import { by } from './dom.js';

const light = matchMedia('(prefers-color-scheme: light)');
const THEMES = ['dark', 'light', 'red'];

export function useTheme(changed) {
  const chosen = /(?:^|; )gonio_theme=(\w+)/.exec(document.cookie)?.[1];
  const select = by('theme');
  select.value = THEMES.includes(chosen) ? chosen : 'auto';
  const apply = () => {
    const automatic = light.matches ? 'light' : 'dark';
    document.documentElement.dataset.theme = select.value === 'auto' ? automatic : select.value;
    changed();
  };
  select.addEventListener('change', () => {
    document.cookie = `gonio_theme=${select.value}; SameSite=Strict; Path=/; Max-Age=31536000`;
    apply();
  });
  light.addEventListener('change', apply);
  apply();
}

export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();
