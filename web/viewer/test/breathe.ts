// SPDX-License-Identifier: Apache-2.0
// Tests that compute without a pause, one after the other, keep Vitest's answers to their worker waiting, which it gives up
// after a minute.
import { beforeEach } from 'vitest';

beforeEach(() => new Promise((resolve) => void setTimeout(resolve)));
