/** What the page looks at with `#self-test`, beside what every page looks at. */
const ownSelfTest = async (found, frames) => {
  const canvas = document.getElementById('view');
  /** A number that follows from every point of the picture. */
  const picture = () => {
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let hash = 0;
    for (let i = 0; i < data.length; i += 1) hash = (Math.imul(hash, 31) + data[i]) | 0;
    return hash;
  };
  const slider = document.getElementById('time');
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
};
