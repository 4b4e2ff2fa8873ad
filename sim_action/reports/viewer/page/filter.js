/** The search box of a long list of scenarios. */

const SHORT_LIST = 8;

/** @param {HTMLElement} list the list with its title */
function offerFilter(list) {
  const items = [...list.querySelectorAll("li:not(.group)")];
  if (items.length < SHORT_LIST) return;
  const box = make("input", { type: "search", placeholder: "Filter", "aria-label": "Filter scenarios", class: "filter" });
  const none = make("p", { class: "faint none", hidden: true, role: "status" }, "No scenario matches.");
  find(list, "ol").before(box, none);
  box.addEventListener("input", () => {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    let left = 0;
    for (const item of items) {
      const group = item.closest("li.group")?.querySelector("summary")?.textContent ?? "";
      const text = `${item.textContent} ${item.querySelector("[aria-label]")?.getAttribute("aria-label")} ${group}`.toLowerCase();
      const shown = words.every((word) => text.includes(word));
      item.toggleAttribute("hidden", !shown);
      left += Number(shown);
    }
    for (const group of list.querySelectorAll("li.group")) {
      group.toggleAttribute("hidden", !group.querySelector("li:not([hidden])"));
    }
    none.hidden = left > 0;
  });
}
