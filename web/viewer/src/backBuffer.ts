// SPDX-License-Identifier: Apache-2.0
// A drawing beside the canvas, to be copied onto it.
import * as THREE from 'three';

export class BackBuffer {
  /** Of what was drawn: its pixels to one of the page's. */
  ratio = 1;
  private readonly size = new THREE.Vector2();
  private readonly target = new THREE.WebGLRenderTarget(1, 1, { colorSpace: THREE.SRGBColorSpace, generateMipmaps: false });

  constructor(private readonly renderer: THREE.WebGLRenderer) {
    // Colours as on the canvas: three converts them into those of the screen for such targets alone.
    Object.assign(this.target, { isXRRenderTarget: true });
  }

  /** As `renderer.render()` on a canvas with so many pixels to one of the page's. */
  render(scene: THREE.Scene, camera: THREE.Camera, ratio: number): void {
    this.ratio = ratio;
    this.renderer.getSize(this.size);
    this.target.setSize(Math.floor(this.size.x * ratio), Math.floor(this.size.y * ratio)); // as three sizes the canvas
    this.renderer.setRenderTarget(this.target);
    this.renderer.render(scene, camera);
    this.renderer.setRenderTarget(null);
  }

  /** Onto the canvas, which has its `ratio`. */
  copy(): void {
    const { state, properties } = this.renderer;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const { __webglFramebuffer: from } = properties.get(this.target) as { __webglFramebuffer?: WebGLFramebuffer };
    if (from === undefined) return; // nothing was drawn
    const { width, height } = this.target;
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
    state.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    state.setScissorTest(false);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  dispose(): void {
    this.target.dispose();
  }
}
