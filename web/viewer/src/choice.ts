// SPDX-License-Identifier: Apache-2.0
// What was chosen last: a file that takes long to open may no longer be wanted. What is said of it meanwhile, and where it
// cannot be opened.
import { sentence } from './sentence';
import type { Presentation } from './state';
import { text } from './strings';

interface Problem {
  readonly name: string;
  readonly why: string;
  readonly overPicture: boolean; // the card stays where it was shown first
}

export class Choice {
  private count = 0; // of files and streams
  private asked: string | null = null; // the file that is being opened
  private problem: Problem | null = null;

  /** A stream. */
  make(): void {
    ++this.count;
    this.asked = this.problem = null; // what was said before is of no interest any more
  }

  /** A file, from now on until opened() or failed(); gives what to ask stillHolds() with. */
  begin(name: string): number {
    this.make();
    this.asked = name;
    return this.count;
  }

  stillHolds(choice: number): boolean {
    return choice === this.count;
  }

  opened(): void {
    this.asked = null;
  }

  failed(name: string, error: unknown, overPicture: boolean): void {
    this.asked = null;
    this.problem = { name, why: error instanceof Error ? error.message : String(error), overPicture };
  }

  /** A person has read it. */
  dismiss(): void {
    this.problem = null;
  }

  get opening(): string | null {
    return this.asked;
  }

  get hasFailed(): boolean {
    return this.problem !== null;
  }

  /** With what is to be said of a file over what else there is. */
  presented(presentation: Presentation): Presentation {
    if (this.problem === null) return presentation;
    const { name, why, overPicture } = this.problem;
    return { ...presentation, title: text.file.failed(name), text: sentence(why), hint: '', dim: overPicture };
  }
}
