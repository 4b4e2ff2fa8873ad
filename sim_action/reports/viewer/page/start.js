/** The start of the page. */

const index = JSON.parse(find(document, "#index").textContent ?? "{}");
document.documentElement.classList.add("scripted");
if (embedded) document.documentElement.classList.add("embed");
const fold = document.querySelector("nav.scenarios > details");
// A class, since a change of any element of a page of thousands would be slow with body:has(nav).
document.documentElement.classList.toggle("listed", fold !== null);
if (innerWidth <= 800) fold?.removeAttribute("open");
// On a wide screen the list is always open.
else fold?.querySelector("summary")?.setAttribute("tabindex", "-1");
offerCopies(document);
const filter = new Filter(index.scenarios);
const suite = document.querySelector("#suite");
const scenarios = new Scenarios(
  index.scenarios,
  filter,
  fold instanceof HTMLElement ? new ScenarioList(fold, filter) : null,
  suite instanceof HTMLElement ? new Suite(suite, filter) : null,
);
listenToKeys(scenarios);
void scenarios.follow();
