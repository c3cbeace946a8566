// SPDX-License-Identifier: Apache-2.0
// Defines <relievo-player>.
import { RelievoPlayer } from './player';

if (customElements.get('relievo-player') === undefined) customElements.define('relievo-player', RelievoPlayer);
export { RelievoPlayer };
