// Guides are found before evidence, and evidence before benchmarks and the history.
const LATER = [["docs/evidence/", 12], ["benchmarks/", 16], ["CHANGELOG", 16], ["agents/policies/", 8]]
var Scorer = {
  score: ([page, , , , score]) => score - (LATER.find(([start]) => page.startsWith(start))?.[1] ?? 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
}
