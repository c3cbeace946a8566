// SPDX-License-Identifier: Apache-2.0
// Why a file is not shown, in words for a person.
import { text } from './strings';

/** Its message is one of strings.ts: what is wrong, and how to mend it. */
export class FileError extends Error {}

/** Of what was thrown while a file of this device was read. */
export function fileError(error: unknown): FileError {
  if (error instanceof FileError) return error;
  const isGone = error instanceof DOMException && (error.name === 'NotReadableError' || error.name === 'NotFoundError');
  return new FileError(isGone ? text.file.unreadable : text.file.damaged);
}
