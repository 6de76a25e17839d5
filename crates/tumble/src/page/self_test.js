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
  const check = async () => {
    // What only one kind of page has is looked at by its own script.
    if (typeof ownSelfTest === 'function') await ownSelfTest(found, frames);
    for (const svg of document.querySelectorAll('svg[data-start]')) {
      const id = svg.closest('figure').id, reading = svg.closest('figure').querySelector('.reading');
      if (!svg.querySelector('.inner path.line[data-name], .inner path.line.c0')) continue;
      const before = reading.textContent;
      chartPage.read(svg, 0.5);
      if (!/[0-9].* at .*[0-9]/.test(reading.textContent) || reading.textContent.includes('NaN')) found.push(id + ' reads "' + reading.textContent + '"');
      chartPage.leave(svg);
      if (reading.textContent !== before) found.push(id + ' keeps what was under the pointer');
      const axes = svg.querySelector('.axes').textContent, view = svg.querySelector('.inner').getAttribute('viewBox');
      chartPage.enlarge(svg, 0.3, 0.6);
      await frames(1);
      if (svg.querySelector('.axes').textContent === axes || svg.querySelectorAll('.axes text').length < 2) found.push(id + ' is not enlarged');
      chartPage.enlarge(svg);
      const after = svg.querySelector('.inner').getAttribute('viewBox').split(' ').map(Number).join(' ');
      if (svg.querySelector('.axes').textContent !== axes || after !== view.split(' ').map(Number).join(' ')) found.push(id + ' does not return');
    }
    const width = document.documentElement.clientWidth;
    if (document.documentElement.scrollWidth > width) found.push('the page is ' + document.documentElement.scrollWidth + ' wide, the window ' + width);
    document.querySelectorAll('details').forEach((node) => { node.open = true; });
    for (const node of document.querySelectorAll('body *')) {
      // What a plot cuts off is not seen.
      if (node.ownerSVGElement) continue;
      // Nor what its own frame lets one move.
      if (node.parentElement.closest('.wide, .picture')) continue;
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
