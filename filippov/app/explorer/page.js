// One redraw is on its way at a time; when it is back, the newest settings are asked for, and no older ones.
window.dash_clientside = window.dash_clientside || {};
window.dash_clientside.explorer = (() => {
  let busy = false, sent = null, wanted = null, timer = null, asked = 0;
  const set = (id, props) => window.dash_clientside.set_props(id, props);
  const send = () => {
    busy = true; sent = wanted; asked = performance.now();
    set("live", { data: JSON.parse(sent) });
  };
  const echoes = {};  // what sync itself has set: no move of the user's
  const nothing = () => window.dash_clientside.no_update;
  return {
    gate: (...values) => {
      const held = {};
      // An emptied box gives null, NaN or undefined: it is asked for as nothing, never left out.
      window.dash_clientside.callback_context.inputs_list.forEach((item, k) => { held[item.id] = values[k] ?? null; });
      wanted = JSON.stringify(held);
      if (!busy && wanted !== sent) send();
      clearTimeout(timer);
      timer = setTimeout(() => set("settled", { data: JSON.parse(wanted) }), 350);
      return nothing();
    },
    done: (answer) => {
      if (!answer) return nothing();
      busy = false;
      window.explorerRedraw = performance.now() - asked;
      if (answer.good) {
        const query = answer.query ? "?" + answer.query : "";
        history.replaceState(null, "", location.pathname + query);
        set("link", { href: location.pathname + query });
        for (const file of answer.files) set("file-" + file.replace(".", "-"), { href: "export/" + file + query });
      }
      if (wanted !== sent) send();
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
