/** The start of the page. */

const index = JSON.parse(find(document, "#index").textContent ?? "{}");
document.documentElement.classList.add("scripted");
if (embedded) document.documentElement.classList.add("embed");
if (innerWidth <= 800) document.querySelector("nav.scenarios > details")?.removeAttribute("open");
for (const list of document.querySelectorAll("nav.scenarios > details")) {
  if (list instanceof HTMLElement) offerFilter(list);
}
offerCopies();
const scenarios = new Scenarios(index.scenarios);
listenToKeys(() => scenarios.player);
void scenarios.follow();
