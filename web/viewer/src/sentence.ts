// SPDX-License-Identifier: Apache-2.0

/** What a server or the decoder says in a message, as a sentence for a person. */
export const sentence = (words: string): string =>
  words === '' ? '' : `${words.charAt(0).toUpperCase()}${words.slice(1)}${/[.?!]$/.test(words) ? '' : '.'}`;
