// SPDX-License-Identifier: Apache-2.0
declare module 'virtual:stage-url' {
  /** Of stage.worker.ts, as it was built (stagePlugin.ts). */
  const url: string;
  export default url;
}
