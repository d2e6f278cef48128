// Words around the scenes: heading, facts, what the colours mean, and the measures of runs side by side.
function fill_labels(content) {
  find("heading").textContent = content.heading;
  find("caption").textContent = content.caption;
  for (const [name, value] of content.facts) {
    const fact = make("span");
    fact.append(make("i", name + " "), make("b", value));
    find("facts").append(fact);
  }
  fill_scores(content);
  const values = {}, alone = content.runs.length === 1;
  for (const entry of content.key) {
    const row = make("span"), swatch = make("i");
    swatch.style.background = entry.colour;
    row.title = entry.hint;
    row.append(swatch, entry.label);
    if (alone && content.runs[0].values[entry.name]) row.append(values[entry.name] = make("b"));
    find("key").append(row);
  }
  return (row) => {
    for (const [name, place] of Object.entries(values)) place.textContent = content.runs[0].values[name][row];
  };
}

function fill_scores(content) {
  if (content.scores.length === 0) return;
  const head = make("tr");
  head.append(make("th", "less is better, ✓ best"));
  for (const run of content.runs) {
    const cell = make("th", run.name);
    cell.style.color = run.colour;
    head.append(cell);
  }
  find("scores").append(head);
  for (const score of content.scores) {
    const row = make("tr");
    row.append(make("td", score.label));
    score.values.forEach((value, k) => row.append(make("td", value, score.best.includes(k) ? "best" : "")));
    find("scores").append(row);
  }
}
