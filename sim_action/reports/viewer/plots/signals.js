/** The choice of further signals to plot: of the base, a link, the joints, and bodies that move. */

const AXES = ["x", "y", "z"];

/**
 * @param {Motion} motion
 * @param {number} link the chosen link
 * @returns {[string, Curve[]][]} groups of curves with their titles
 */
function signalGroups(motion, link) {
  const { scene, base, tracks, times } = motion;
  const places = (/** @type {string} */ name, /** @type {Float64Array[]} */ columns) =>
    AXES.map((axis, i) => freeCurve(`${name} ${axis}`, "m", times, columns[i]));
  /** @type {[string, Curve[]][]} */
  const groups = [["Base", [...baseCurves(motion), ...places(scene.links[0].name, base)]]];
  if (link > 0) groups.push(["Link", places(scene.links[link].name, motion.trail(link))]);
  groups.push(["Joints", motion.joints.map((_, i) => jointCurve(motion, i))]);
  const moving = scene.bodies.filter(({ track }) => track !== undefined);
  groups.push(["Objects", moving.flatMap(({ name, track }) => places(name, tracks[track ?? 0]))]);
  return groups.filter(([, curves]) => curves.length);
}

/** The list from which a signal is added as a plot. */
class SignalChoice {
  /**
   * @param {Motion} motion
   * @param {(curve: Curve) => void} add
   */
  constructor(motion, add) {
    this.motion = motion;
    /** @type {Curve[]} */
    this.curves = [];
    this.list = make("select", { "aria-label": "Add a plot" });
    this.element = make("div", { class: "choice" }, this.list);
    this.list.addEventListener("change", () => {
      const curve = this.curves[Number(this.list.value)];
      this.list.value = "";
      if (curve) add(curve);
    });
    this.offer(0);
  }

  /** Offers the signals of the base, the joints, the bodies and one link. @param {number} link */
  offer(link) {
    const groups = signalGroups(this.motion, link);
    this.curves = groups.flatMap(([, curves]) => curves);
    const option = (/** @type {Curve} */ curve) => make("option", { value: this.curves.indexOf(curve) }, curve.name);
    const listed = groups.map(([title, curves]) => make("optgroup", { label: title }, ...curves.map(option)));
    this.list.replaceChildren(make("option", { value: "" }, "Add a plot …"), ...listed);
  }
}
