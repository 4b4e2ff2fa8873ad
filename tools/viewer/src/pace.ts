/** The pace of a view that the processor draws: fewer pixels while the picture moves, all of them once it rests. */

import { ShaderChunk } from "three";

/** Frames that are asked for within so many ms after each other are of a picture that moves. */
const QUICK = 300;
/** So many of them stay sharp, as those of single steps and of choices. */
const SHARP = 3;
/** After so many ms without a frame a picture rests. */
const REST = 250;
/** The share of pixels along a side while the picture moves. */
const MOVING = 0.5;

/** Returns true if there is no graphics card, so that every pixel costs processor time. */
export function isDrawnByProcessor(context: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  const named = context.getExtension("WEBGL_debug_renderer_info");
  const renderer = String(context.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

/** Has shadows read their map once for each pixel, in place of five times around it. */
export function shadeCheaply(): void {
  ShaderChunk.shadowmap_pars_fragment = ShaderChunk.shadowmap_pars_fragment.replace(
    /shadow = \(\s*(?:texture\([^;]+\) \+\s*)+texture\([^;]+\)\s*\) \* 0\.2;/,
    "shadow = texture( shadowMap, shadowCoord.xyz );",
  );
}

export class Pace {
  /** When the last frame was there to be seen, in ms; Infinity: it is under way. */
  private seen = -Infinity;
  private quick = 0;
  private waiting = 0;

  /** @param onRest asks for a frame with all pixels */
  constructor(private readonly onRest: () => void) {}

  /**
   * Returns the share of pixels along a side of the frame that is drawn now.
   * @param isOther the frame is of another time, or seen from elsewhere
   */
  share(isOther: boolean): number {
    this.dispose();
    this.quick = isOther && performance.now() - this.seen < QUICK ? this.quick + 1 : 0;
    this.seen = Infinity;
    const isMoving = this.quick >= SHARP;
    // A frame may take longer than a rest: the browser calls once it has room for the next one.
    requestAnimationFrame(() => {
      this.seen = performance.now();
      if (isMoving) this.waiting = setTimeout(this.onRest, REST);
    });
    return isMoving ? MOVING : 1;
  }

  dispose(): void {
    clearTimeout(this.waiting);
  }
}
