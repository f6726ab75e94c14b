// Values of the point beside the pointer. The report is complete without this script.
'use strict';
(() => {
  const REACH_PX = 18;
  const GAP_PX = 14;
  const texts = JSON.parse(document.getElementById('points').textContent);
  const box = document.body.appendChild(document.createElement('output'));
  box.className = 'beside-pointer';
  box.hidden = true;
  let near = null;

  function hide() {
    near?.classList.remove('near');
    near = null;
    box.hidden = true;
  }

  function nearest(svg, event) {
    const matrix = svg.getScreenCTM();
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    let [best, found] = [REACH_PX / matrix.a, null];
    for (const mark of svg.querySelectorAll('.marks circle')) {
      const far = Math.hypot(mark.getAttribute('cx') - at.x, mark.getAttribute('cy') - at.y);
      if (far < best) [best, found] = [far, mark];
    }
    return found;
  }

  function place(event) {
    const { width, height } = box.getBoundingClientRect();
    const left = Math.min(event.clientX + GAP_PX, innerWidth - width - 4);
    const above = event.clientY - height - GAP_PX;
    box.style.left = `${Math.max(4, left)}px`;
    box.style.top = `${above > 4 ? above : event.clientY + GAP_PX}px`;
  }

  function look(event) {
    const found = nearest(event.currentTarget, event);
    if (!found || !texts[found.dataset.p]) return hide();
    if (found !== near) hide();
    near = found;
    near.classList.add('near');
    box.textContent = texts[near.dataset.p];
    box.hidden = false;
    place(event);
  }

  for (const svg of document.querySelectorAll('.chart > svg')) {
    if (!svg.querySelector('.marks')) continue;
    svg.addEventListener('pointermove', look);
    svg.addEventListener('pointerdown', look);
    svg.addEventListener('pointerleave', hide);
  }
  addEventListener('scroll', hide, { passive: true });
})();
