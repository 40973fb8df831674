"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  const BEST = "#D55E00", POSSIBLE = "#0072B2", RULED_OUT = "#9a9a9a", INK = "#222222";
  const PLAIN = { displayModeBar: false, responsive: true };
  const NAMES = { spanning_trees: "s_ST", von_neumann: "s_VN", von_neumann_approx: "ŝ_VN", von_neumann_normalized: "normalised ŝ_VN" };
  const number = (value, digits = 2) => (value === null ? "–" : value.toFixed(digits).replace("-", "−"));
  const option = (select, value, text) => select.append(new Option(text, value));
  let selected = null;   // index of the action that is shown everywhere
  let shown = [];        // indices of the actions that pass the filters

  const layout = (title, more) => Object.assign({
    title: { text: title, font: { size: 13 }, x: 0.01, xanchor: "left" }, margin: { l: 52, r: 10, t: 34, b: 40 },
    font: { family: "system-ui, sans-serif", size: 12, color: INK }, hovermode: "closest", showlegend: false, dragmode: false,
    paper_bgcolor: "#fff", plot_bgcolor: "#fff",
  }, more);

  // one decision
  const current = () => data.sessions.find((s) => s.name === at("session").value && String(s.xi) === at("xi").value);
  const standing = (session, family) => {
    const lower = session.actions.map((a) => a[family + "_lower"]), upper = session.actions.map((a) => a[family + "_upper"]);
    const ranked = session.actions.map((a) => a.spanning_trees);
    const first = ranked.indexOf(Math.max(...ranked));
    return session.actions.map((_, i) => (i === first || lower[i] <= upper[first] ? POSSIBLE : RULED_OUT));
  };
  const best = (session) => {
    const J = session.actions.map((a) => a.joint);
    return J.indexOf(Math.min(...J));
  };
  const describe = (session, index) => {
    const a = session.actions[index], f = at("family").value;
    return `Path ${a.action} of ${session.actions.length}: ${number(a.length, 1)} m, ${a.num_new_poses} new poses, ` +
      `${a.num_closures} closures. Joint entropy ${number(a.joint)} nats, between ${number(a[f + "_lower"])} and ` +
      `${number(a[f + "_upper"])} by bounds; map entropy ${number(a.map)}. s_ST ${number(a.spanning_trees)}, ` +
      `s_VN ${number(a.von_neumann, 3)}, ŝ_VN ${number(a.von_neumann_approx, 3)}.`;
  };

  function choose(index) {
    if (index === selected || !shown.includes(index)) return;
    selected = index;
    mark();
  }

  function mark() {
    const session = current(), path = session.paths[selected], a = session.actions[selected], place = shown.indexOf(selected);
    at("selected").textContent = describe(session, selected);
    Plotly.restyle("map", { x: [path.map((p) => p[0])], y: [path.map((p) => p[1])] }, [at("map").data.length - 1]);
    Plotly.restyle("bounds", { x: [[a.joint]], y: [[place]] }, [at("bounds").data.length - 1]);
    Plotly.restyle("scatter", { x: [[a[at("signature").value]]], y: [[a.joint]] }, [at("scatter").data.length - 1]);
    for (const row of at("actions").tBodies[0].rows) row.classList.toggle("on", Number(row.dataset.index) === selected);
  }

  function drawDecision() {
    const session = current(), family = at("family").value, signature = at("signature").value;
    const colours = standing(session, family);
    at("length-shown").textContent = at("longest").value;
    shown = session.actions.map((_, i) => i)
      .filter((i) => session.actions[i].length <= Number(at("longest").value))
      .filter((i) => !at("survivors").checked || colours[i] === POSSIBLE)
      .sort((i, j) => session.actions[i].joint - session.actions[j].joint);
    at("count").textContent = `${shown.length} of ${session.actions.length} candidates shown. ` +
      `Blue: may be the best by these bounds; grey: ruled out without an evaluation; orange: the one you point at.`;
    drawMap(session, colours);
    drawBounds(session, colours, family);
    drawScatter(session, colours, signature);
    drawTable(session);
    if (!shown.includes(selected)) selected = shown.includes(best(session)) ? best(session) : shown[0];
    if (shown.length) mark();
    else { selected = null; at("selected").textContent = "No candidate passes the filters."; }
  }

  function drawMap(session, colours) {
    const line = (points) => ({ x: points.map((p) => p[0]), y: points.map((p) => p[1]), mode: "lines", hoverinfo: "skip" });
    const traces = data.walls.map((ring) => ({ ...line(ring), line: { color: "#A5A8AD", width: 1 } }));
    if (session.prior.length > 1) traces.push({ ...line(session.prior), line: { color: "#5B6C7D", width: 4 } });
    for (const i of [...shown].reverse()) {
      traces.push({ ...line(session.paths[i]), line: { color: colours[i], width: 2 }, hoverinfo: "text", meta: i,
        text: `path ${session.actions[i].action}: J ${number(session.actions[i].joint, 1)} nats`, hoveron: "points" });
    }
    const end = (point, symbol, size, colour) => ({ x: [point[0]], y: [point[1]], mode: "markers", hoverinfo: "skip",
      marker: { symbol, size, color: colour, line: { color: INK, width: 1 } } });
    traces.push(end(session.start, "circle", 10, "#fff"), end(session.goal, "star", 15, "#F0E442"));
    traces.push({ ...line([]), line: { color: BEST, width: 5 }, name: "selected" });
    Plotly.react("map", traces, layout(`${session.name}: candidate paths`, {
      xaxis: { title: { text: "x (m)" }, zeroline: false, showgrid: false, constrain: "domain" },
      yaxis: { title: { text: "y (m)" }, zeroline: false, showgrid: false, scaleanchor: "x" } }), PLAIN);
  }

  function drawBounds(session, colours, family) {
    const J = shown.map((i) => session.actions[i].joint), places = shown.map((_, place) => place);
    const below = shown.map((i) => session.actions[i].joint - session.actions[i][family + "_lower"]);
    const above = shown.map((i) => session.actions[i][family + "_upper"] - session.actions[i].joint);
    const intervals = shown.map((i, place) => ({ x: [J[place] - below[place], J[place] + above[place]], y: [place, place],
      mode: "lines", line: { color: colours[i], width: 6 }, opacity: 0.6, hoverinfo: "skip" }));
    const exact = { x: J, y: places, mode: "markers", customdata: shown, marker: { color: INK, symbol: "diamond", size: 7 },
      text: shown.map((i) => `path ${session.actions[i].action}`), hovertemplate: "%{text}: J %{x:.2f} nats<extra></extra>" };
    Plotly.react("bounds", [...intervals, exact, ring()], layout("Joint entropy within its bounds (nats)", {
      yaxis: { autorange: "reversed", tickvals: places, ticktext: shown.map((i) => `path ${session.actions[i].action}`),
        zeroline: false, showgrid: false, tickfont: { size: 9 }, automargin: true },
      xaxis: { zeroline: false, gridcolor: "#e6e6e6" } }), PLAIN);
  }

  function drawScatter(session, colours, signature) {
    const points = { x: shown.map((i) => session.actions[i][signature]), y: shown.map((i) => session.actions[i].joint),
      mode: "markers", customdata: shown, marker: { color: shown.map((i) => colours[i]), size: 9 },
      text: shown.map((i) => `path ${session.actions[i].action}`),
      hovertemplate: "%{text}: %{x:.3f}, J %{y:.2f} nats<extra></extra>" };
    Plotly.react("scatter", [points, ring()], layout(`Joint entropy (nats) against ${NAMES[signature]}`, {
      xaxis: { zeroline: false, gridcolor: "#e6e6e6" }, yaxis: { zeroline: false, gridcolor: "#e6e6e6" } }), PLAIN);
  }

  const ring = () => ({ x: [], y: [], mode: "markers", hoverinfo: "skip", name: "selected",
    marker: { symbol: "circle-open", size: 17, color: BEST, line: { width: 3, color: BEST } } });

  function drawTable(session) {
    const columns = [["path", (a) => `path ${a.action}`], ["length (m)", (a) => number(a.length, 1)], ["poses", (a) => a.num_new_poses],
      ["closures", (a) => a.num_closures], ["J", (a) => number(a.joint)], ["J map", (a) => number(a.map)],
      ["J per pose", (a) => number(a.per_pose, 3)], ["s_ST", (a) => number(a.spanning_trees)], ["s_VN", (a) => number(a.von_neumann, 3)],
      ["ŝ_VN", (a) => number(a.von_neumann_approx, 3)]];
    const table = at("actions");
    table.replaceChildren();
    const head = table.createTHead().insertRow(), body = table.createTBody();
    for (const [name] of columns) head.append(Object.assign(document.createElement("th"), { textContent: name }));
    for (const i of shown) {
      const row = body.insertRow();
      row.dataset.index = i;
      for (const [, value] of columns) row.insertCell().textContent = value(session.actions[i]);
      row.addEventListener("mouseenter", () => choose(i));
      row.addEventListener("click", () => choose(i));
    }
  }

  function sessionChanged() {
    const lengths = current().actions.map((a) => a.length), range = at("longest");
    range.min = Math.ceil(Math.min(...lengths));
    range.max = Math.ceil(Math.max(...lengths));
    range.value = range.max;
    selected = best(current());
    drawDecision();
  }

  // claims
  function filterClaims() {
    const rows = [...at("claims-table").tBodies[0].rows];
    for (const row of rows) {
      row.hidden = (at("verdict").value && row.dataset.holds !== at("verdict").value) ||
        (at("topic").value && row.dataset.topic !== at("topic").value);
    }
    at("claims-count").textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length} lines shown.`;
  }

  // random graphs
  function drawGraphs() {
    const signature = at("graph-signature").value, perPose = at("per-pose").checked;
    const sizes = [...new Set(data.graphs.map((g) => g.num_poses))].sort((a, b) => a - b);
    const colours = ["#A6D1EE", "#7DB8DE", "#4A94CB", "#23679F", "#0B2F5B"];
    const traces = sizes.map((n, place) => {
      const rows = data.graphs.filter((g) => g.num_poses === n && g[signature] !== null), over = perPose ? n : 1;
      return { name: `n = ${n}`, mode: "markers", x: rows.map((g) => g[signature] / over), y: rows.map((g) => g.joint / over),
        marker: { color: colours[place % colours.length], size: 7 },
        text: rows.map((g) => `n = ${n}, Δd = ${g.degree_increase}<br>s_ST ${number(1e3 * g.spanning_trees_seconds, 2)} ms, ` +
          `ŝ_VN ${number(1e3 * g.von_neumann_approx_seconds, 2)} ms`),
        hovertemplate: "%{text}<br>signature %{x:.4f}, J %{y:.4f}<extra></extra>" };
    });
    Plotly.react("graph-plot", traces, layout(`Joint entropy against ${NAMES[signature]} (nats${perPose ? " a pose" : ""})`, {
      showlegend: true, legend: { orientation: "h", y: -0.15 }, margin: { l: 60, r: 10, t: 34, b: 60 },
      xaxis: { zeroline: false, gridcolor: "#e6e6e6" }, yaxis: { zeroline: false, gridcolor: "#e6e6e6" } }), PLAIN);
  }

  for (const name of new Set(data.sessions.map((s) => s.name))) option(at("session"), name, name);
  for (const xi of new Set(data.sessions.map((s) => s.xi))) option(at("xi"), String(xi), String(xi));
  for (const [name, text] of Object.entries(NAMES)) { option(at("signature"), name, text); option(at("graph-signature"), name, text); }
  const topics = new Set([...at("claims-table").tBodies[0].rows].map((row) => row.dataset.topic));
  for (const topic of topics) option(at("topic"), topic, topic);
  at("session").value = data.sessions[data.sessions.length - 1].name;
  at("xi").value = String(data.sessions[Math.floor(new Set(data.sessions.map((s) => s.xi)).size / 2)].xi);
  for (const id of ["session", "xi"]) at(id).addEventListener("change", sessionChanged);
  for (const id of ["family", "signature", "survivors"]) at(id).addEventListener("change", drawDecision);
  at("longest").addEventListener("input", drawDecision);
  for (const id of ["verdict", "topic"]) at(id).addEventListener("change", filterClaims);
  for (const id of ["graph-signature", "per-pose"]) at(id).addEventListener("change", drawGraphs);
  sessionChanged();
  filterClaims();
  drawGraphs();
  for (const id of ["map", "bounds", "scatter"]) {
    const listen = (event) => {
      const point = event.points[0];
      choose(id === "map" ? point.data.meta : point.customdata);
    };
    at(id).on("plotly_hover", listen);
    at(id).on("plotly_click", listen);
  }
})();
