// The solution as a film: a line over the time response and a point over the phase portrait go along the solution.
// Both lie over the pictures, which are not drawn again.
window.explorerFilm = (() => {
  const SECONDS = 6;
  let film = null, share = 0, playing = false, last = 0, button = null, range = null, told = null;
  const at = (id) => document.getElementById(id);

  const build = () => {
    button = Object.assign(document.createElement("button"), { type: "button", id: "play", textContent: "Play" });
    range = Object.assign(document.createElement("input"), { type: "range", id: "moment", min: 0, max: 1, step: 0.001 });
    range.value = 0;
    const name = document.createElement("label"), hint = document.createElement("span");
    hint.className = "unseen"; hint.textContent = "moment of the solution";
    name.append(hint, range);
    told = Object.assign(document.createElement("output"), { id: "moment-told", htmlFor: "moment" });
    at("film").append(button, name, told);
    button.onclick = () => { if (playing) pause(); else play(); };
    range.oninput = () => { pause(); share = Number(range.value); place(); };
  };
  const pause = () => { playing = false; button.textContent = "Play"; };
  const play = () => {
    playing = true; button.textContent = "Pause"; last = performance.now();
    if (share >= 1) share = 0;
    requestAnimationFrame(step);
  };
  const step = (now) => {
    if (!playing) return;
    share = Math.min(1, share + Math.max(0, now - last) / 1000 / SECONDS);
    last = now;
    range.value = share;
    place();
    if (share >= 1) pause(); else requestAnimationFrame(step);
  };
  // The last sample that is not after a time, in the sense in which the solution runs.
  const before = (values, time, sense) => {
    let low = 0, high = values.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (sense * (values[middle] - time) <= 0) low = middle; else high = middle - 1;
    }
    return low;
  };
  const mark = (name, shape) => {
    const plot = document.querySelector(`#figure-${name} .js-plotly-plot`);
    const box = plot?.querySelector(".svg-container");
    if (!box || !plot._fullLayout?.xaxis) return null;
    const own = box.querySelector("." + shape) || box.appendChild(
      Object.assign(document.createElement("div"), { className: shape, ariaHidden: "true" }));
    return { layout: plot._fullLayout, own };
  };
  const put = (own, shown, left, top, height) => {
    Object.assign(own.style, { display: shown ? "block" : "none", left: left + "px", top: top + "px" });
    if (height !== undefined) own.style.height = height + "px";
  };
  const place = () => {
    const { t, x, y, modes, label } = film, sense = t[t.length - 1] < t[0] ? -1 : 1;
    const time = t[0] + share * (t[t.length - 1] - t[0]), k = before(t, time, sense);
    const part = k + 1 < t.length && t[k + 1] !== t[k] ? (time - t[k]) / (t[k + 1] - t[k]) : 0;
    const between = (values) => (part ? values[k] + part * (values[k + 1] - values[k]) : values[k]);
    told.value = `${label} = ${Number(time.toPrecision(4))}, ${modes[before(modes.map((m) => m[0]), time, sense)][1]}`;
    const line = mark("time", "film-line"), point = mark("phase", "film-point");
    if (line) {
      const { xaxis, _size } = line.layout, left = xaxis.l2p(time);
      put(line.own, left >= 0 && left <= xaxis._length, xaxis._offset + left, _size.t, _size.h);
    }
    if (point && point.layout.yaxis) {
      const { xaxis, yaxis } = point.layout, left = xaxis.l2p(between(x)), top = yaxis.l2p(between(y));
      const inside = left >= 0 && left <= xaxis._length && top >= 0 && top <= yaxis._length;
      put(point.own, inside, xaxis._offset + left, yaxis._offset + top);
    }
  };
  return (made) => {
    film = made;
    if (!button) build();
    place();
    for (const name of ["time", "phase"]) {  // follows where a picture is drawn, zoomed or resized
      const plot = document.querySelector(`#figure-${name} .js-plotly-plot`);
      if (plot?.on && !plot.filmed) { plot.filmed = true; plot.on("plotly_afterplot", place); }
    }
  };
})();
