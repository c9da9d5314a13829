// One redraw is on its way at a time; when it is back, the newest settings are asked for, and no older ones.
// A picture of which less than a fifth is in the window waits until it is scrolled to, or until the sliders rest.
window.dash_clientside = window.dash_clientside || {};
window.dash_clientside.explorer = (() => {
  const REST = 350;
  let busy = false, sent = null, wanted = null, timer = null, sweep = 0, diagram = null;
  const search = location.search, waiting = {}, seen = new Set();
  const shown = {}, echoes = {};  // figures as text, as they are drawn; what sync itself has set
  const at = (id) => document.getElementById(id);
  const set = (id, props) => window.dash_clientside.set_props(id, props);
  const nothing = () => window.dash_clientside.no_update;
  const ask = (what, settings) => fetch(what, {
    method: "POST", headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ settings: JSON.parse(settings), search }),
  }).then((answer) => answer.json());
  const tell = (text, bad) => { at("message").textContent = text; at("message").className = bad ? "bad" : ""; };

  const draw = (name) => {
    const wait = waiting[name], plot = document.querySelector(`#figure-${name} .js-plotly-plot`);
    // Before its first, empty picture is drawn a pane can show no other one: `settle` comes back to it.
    if (!wait || !window.Plotly || !plot || !plot.layout) return null;
    delete waiting[name];
    const { figure, text } = wait;
    if (shown[name] === text) return null;  // as the mode graph, which most steps of a slider leave as it is
    shown[name] = text;
    // At the size that it has: to find out its size costs the browser a layout of the whole page.
    const { width, height } = plot._fullLayout;
    return Plotly.react(plot, figure.data, { ...figure.layout, autosize: true, width, height });
  };
  const eye = new IntersectionObserver((entries) => entries.forEach((entry) => {
    const name = entry.target.id.slice("figure-".length);
    if (entry.isIntersecting) { seen.add(name); draw(name); } else seen.delete(name);
  }), { threshold: 0.2 });
  const show = (figures) => {
    for (const [name, figure] of Object.entries(figures)) {
      eye.observe(at("figure-" + name));
      waiting[name] = { figure, text: JSON.stringify(figure) };
    }
    return Promise.all(Object.keys(figures).filter((name) => seen.has(name)).map(draw));
  };
  const settle = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      Object.keys(waiting).forEach(draw);
      if (Object.keys(waiting).length) settle();
    }, REST);
  };

  const send = async () => {
    busy = true; sent = wanted;
    const asked = performance.now();
    try {
      const answer = await ask("redraw", sent);
      tell(answer.said, !answer.good);
      if (answer.drawn) {
        const query = answer.query ? "?" + answer.query : "";
        history.replaceState(null, "", location.pathname + query);
        at("link").href = location.pathname + query;
        for (const file of answer.files) at("file-" + file.replace(".", "-")).href = "export/" + file + query;
      }
      if (answer.here && diagram) {
        diagram.data[0] = answer.here;
        answer.figures.diagram = diagram;
      }
      await show(answer.figures);
      if (answer.film) window.explorerFilm(answer.film);
      window.explorerRedraw = performance.now() - asked;
    } catch (error) {
      tell(`No answer from this page's server (${error.message}): is the command or the notebook still running?`, true);
    }
    busy = false;
    if (wanted !== sent) send();
  };
  const over = async () => {
    const mine = ++sweep, found = at("figure-diagram") && await ask("diagram", wanted).catch(() => null);
    if (mine !== sweep) return;
    if (found?.postponed) { timer = setTimeout(over, REST); return; }  // it has made way for a redraw
    if (found) { diagram = found; await show({ diagram }); }
    settle();
  };
  return {
    gate: (...values) => {
      const held = {};
      // An emptied box gives null, NaN or undefined: it is asked for as nothing, never left out.
      window.dash_clientside.callback_context.inputs_list.forEach((item, k) => { held[item.id] = values[k] ?? null; });
      wanted = JSON.stringify(held);
      if (!busy && wanted !== sent) send();
      clearTimeout(timer);
      timer = setTimeout(over, REST);
      return nothing();
    },
    // A slider and the number beside it show one value; whatever was moved sets the other.
    sync: (...values) => {
      const context = window.dash_clientside.callback_context;
      const held = {};
      context.inputs_list.forEach((item, k) => { held[item.id] = values[k]; });
      const ranges = held["ranges"] || {};
      const moved = context.triggered.map((item) => item.prop_id.split(".")[0]);
      for (const id of moved) {
        const other = id.startsWith("range-") ? id.slice(6) : "range-" + id;
        // A slider that is given no number goes to its middle, so it is given none.
        const value = held[id] === null || held[id] === "" ? NaN : Number(held[id]);
        const echo = echoes[id] === value;
        delete echoes[id];
        if (other in held && !echo && Number.isFinite(value) && Number(held[other]) !== value) {
          echoes[other] = value;
          set(other, { value });
        }
      }
      if (moved.includes("over") && !moved.includes("low") && ranges[held["over"]]) {
        set("low", { value: ranges[held["over"]][0] });
        set("high", { value: ranges[held["over"]][1] });
      }
      return nothing();
    },
  };
})();
