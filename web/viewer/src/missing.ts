// SPDX-License-Identifier: Apache-2.0
// Why parts of a recording do not come from its server.

/** They may later. */
export class Unavailable extends Error {}

/** Nobody answers, or no more of the answer comes. */
export class NoAnswer extends Unavailable {
  constructor() {
    super('the server does not answer');
  }
}

/** The server lets nobody in without a token. A page gets one when a person signs in, in any tab. */
export class NoToken extends Unavailable {
  constructor() {
    super('the server wants a token for it: load this page anew to sign in');
  }
}

/** Asking again does not help. */
export class Final extends Error {}
