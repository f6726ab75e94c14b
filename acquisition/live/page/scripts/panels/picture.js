// The camera's newest picture with the measured window. Picture and outline change together, and one
// picture is fetched at a time: those that come meanwhile are left out.

import { by, makeSvg, show, write } from '../dom.js';
import { pictureAddress } from '../requests.js';

export class Picture {
  constructor() {
    Object.assign(this, { shown: null, loading: null });
  }

  show(scan) {
    if (!scan.picture) {
      write('no-picture', 'No picture from the camera now.');
    } else if (scan.picture.number !== this.shown && this.loading === null) {
      this.load(scan);
    }
  }

  // A picture that is superseded before it arrives is answered by 404: the newest one is next.
  load(scan) {
    const { picture } = scan;
    const image = new Image();
    const then = (put) => () => {
      this.loading = null;
      this.shown = picture.number;
      if (put) this.put(image, picture);
      this.show(scan);
    };
    this.loading = picture.number;
    image.onload = then(true);
    image.onerror = then(false);
    image.src = pictureAddress(picture.number);
  }

  put(image, picture) {
    image.id = 'picture';
    image.alt = `The camera’s newest picture: ${picture.caption}`;
    by('picture').replaceWith(image);
    image.parentElement.style.setProperty('--aspect', picture.width_px / picture.height_px);
    show('no-picture', false);
    show('picture-legend', true);
    drawOutline(picture);
    write('caption', picture.caption);
  }
}

// The outline is in pixels of the whole picture, whose centres are whole numbers.
function drawOutline({ outline, width_px, height_px }) {
  const svg = by('outline');
  svg.setAttribute('viewBox', `0 0 ${width_px} ${height_px}`);
  const points = (outline ?? []).map(([x, y]) => `${x + 0.5},${y + 0.5}`).join(' ');
  const classes = points ? ['outline-halo', 'outline-line'] : [];
  svg.replaceChildren(...classes.map((name) => makeSvg('polygon', { points, class: name })));
}
