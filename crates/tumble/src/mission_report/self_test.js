// With `#self-test` the page looks at itself and writes what it found where a program can read it.
(() => {
  if (location.hash !== '#self-test') return;
  const found = [];
  addEventListener('error', (event) => found.push('error: ' + event.message));
  addEventListener('unhandledrejection', (event) => found.push('error: ' + event.reason));
  addEventListener('securitypolicyviolation', (event) => found.push('refused: ' + event.violatedDirective));
  const frames = (count) => new Promise((done) => {
    const next = (left) => (left ? requestAnimationFrame(() => next(left - 1)) : done());
    next(count);
  });
  const canvas = document.getElementById('view');
  /** A number that follows from every point of the picture. */
  const picture = () => {
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let hash = 0;
    for (let i = 0; i < data.length; i += 1) hash = (Math.imul(hash, 31) + data[i]) | 0;
    return hash;
  };
  const slider = document.getElementById('time');
  const check = async () => {
    const end = missionPage.end;
    if (!(end > 0)) found.push('there is nothing to play');
    const pictures = new Set();
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      slider.value = String(share * end);
      slider.dispatchEvent(new Event('input'));
      await frames(2);
      pictures.add(picture());
    }
    if (pictures.size < 4) found.push('the slider does not move the picture');
    if (new Set(document.getElementById('now').textContent).size < 2) found.push('no event is named');
    const still = picture();
    missionPage.turn(0.5, 0.1);
    await frames(2);
    if (picture() === still) found.push('the view does not turn');
    missionPage.view('corner');
    missionPage.seek(0.3 * end);
    await frames(2);
    const before = missionPage.time(), first = picture();
    document.getElementById('play').click();
    await new Promise((done) => setTimeout(done, 2500));
    await frames(2);
    if (!(missionPage.time() > before && Number(slider.value) > before)) found.push('playing does not advance the time');
    if (picture() === first) found.push('playing does not change the picture');
    if (missionPage.isPlaying()) document.getElementById('play').click();
    const halted = missionPage.time();
    await frames(3);
    if (missionPage.time() !== halted) found.push('pause does not stop');
    const width = document.documentElement.clientWidth;
    if (document.documentElement.scrollWidth > width) found.push('the page is ' + document.documentElement.scrollWidth + ' wide, the window ' + width);
    document.querySelectorAll('details').forEach((node) => { node.open = true; });
    for (const node of document.querySelectorAll('body *')) {
      // What a plot cuts off is not seen.
      if (node.ownerSVGElement) continue;
      const box = node.getBoundingClientRect();
      if (box.width > 0 && (box.right > width + 1 || box.left < -1)) found.push(node.tagName + '#' + node.id + '.' + node.className + ' reaches from ' + box.left.toFixed(0) + ' to ' + box.right.toFixed(0) + ' of ' + width);
    }
    for (const node of document.querySelectorAll('svg text, th, td, p, dd, label')) {
      const size = parseFloat(getComputedStyle(node).fontSize);
      const owner = node.ownerSVGElement;
      const scale = owner && owner.viewBox.baseVal.width ? owner.getBoundingClientRect().width / owner.viewBox.baseVal.width : 1;
      if (size * scale < 9) { found.push('text of ' + (size * scale).toFixed(1) + ' px: ' + node.textContent.slice(0, 40)); break; }
    }
    for (const figure of document.querySelectorAll('figure.plot')) {
      if (figure.querySelector('svg').getBoundingClientRect().height < 80) found.push(figure.id + ' is flat');
    }
    const loaded = performance.getEntriesByType('resource').map((entry) => entry.name);
    if (loaded.length) found.push('loaded: ' + loaded.join(' '));
    return width;
  };
  const report = (width) => {
    const node = document.createElement('pre');
    node.id = 'self-test-outcome';
    node.textContent = 'self-test at ' + width + ' px: ' + (found.length ? 'FAILED\n' + found.join('\n') : 'passed') + '\nend of self-test';
    document.body.append(node);
  };
  check().then(report, (error) => { found.push('error: ' + error); report(document.documentElement.clientWidth); });
})();
