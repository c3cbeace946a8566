// SPDX-License-Identifier: Apache-2.0
// What the page /rig says, in one place.
import type { PictureName } from './look';

const pictures: Record<PictureName, readonly [string, string]> = {
  camera: ['Camera', 'The exposure under the slide, as the camera gives it'],
  complement: ['Complement', 'The exposure after it'],
  exposure: ['Exposure', 'Red: clipped. Blue: dark in both exposures'],
  coverage: ['Coverage', 'Green: stripes are decoded. Red: their light arrives, and they are not'],
  order: ['Order', 'Magenta: neighbouring boundaries that do not fit together'],
  difference: ['Difference', 'The difference of both exposures: what stripes are read from'],
  boundaries: ['Boundaries', 'Decoded boundaries, in the colours projected on both sides'],
};

export const text = {
  pictures,
  state: {
    connecting: 'Connecting',
    waiting: 'Waiting for a frame of the camera',
    live: (frame: number) => `Frame ${frame}`,
    lost: 'The server does not answer: trying again',
    noStream: 'The server has no streams yet',
  },
  advice: { title: 'What to do', none: 'Nothing to mend in this frame.' },
  exposure: {
    title: 'Exposure',
    histogram: (clipped: string, dark: string) =>
      `Histogram of red, green and blue over the levels 0 to 255. Clipped: ${clipped}. Dark: ${dark}.`,
    clipped: (level: number) => `clipped (${level} or more)`,
    dark: (level: number) => `dark (below ${level})`,
    bright: 'level of the brightest hundredth',
  },
  margins: {
    title: 'Colour margins',
    about: (needed: number, noise: number) =>
      `How far a colour is from being taken for another, of 255: 95 of 100 stripes have at least this. ${
        needed
      } is needed; the noise is ${noise.toFixed(1)}.`,
    columns: ['Colour', 'Least', '', 'Wrong'],
    none: '–',
  },
  colours: {
    '100': 'Red',
    '010': 'Green',
    '001': 'Blue',
    '110': 'Yellow',
    '101': 'Magenta',
    '011': 'Cyan',
  } as Readonly<Record<string, string>>,
  stripes: {
    title: 'Stripes',
    coverage: 'decoded, of where their light arrives',
    lit: 'of the picture is lit by them',
    seen: 'boundaries seen',
    points: 'points of the surface',
    order: 'order errors, of neighbours',
  },
  step: {
    title: 'Projector and camera',
    mixed: 'frames lost under two slides',
    phase: 'phase, of an exposure',
    drift: 'drift, fields a second',
    unknown: 'not known',
  },
  projector: {
    title: 'Projector',
    states: { none: '', off: 'Off', on: 'On', failed: 'Failed' },
    on: (output: string, show: string) => `${output}: ${show}`,
    show: 'Show',
    shows: { pattern: 'The pattern', white: 'White, to aim', slide1: 'A slide, to focus', black: 'Black' },
    start: 'Project',
    stop: 'Stop',
    failed: (why: string) => `Not done: ${why}`,
  },
  calibration: {
    title: 'Calibration',
    caption: 'What the camera sees, without the pattern',
    coverage: 'Where corners were seen; red: not yet. How the board was tilted:',
    camera: 'Camera',
    projector: 'Projector',
    sides: { left: 'Left', right: 'Right', upper: 'Upper', lower: 'Lower' },
    tilt: (side: string, seen: boolean) => `${side} side away${seen ? '' : ': not yet'}`,
    state: (stream: string) => `Calibrating ${stream}`,
    what: 'Calibrate',
    kinds: { colour: 'Colours', geometry: 'Geometry' },
    about: {
      colour: 'With a matt white sheet, in a dark room. Colours first: the stripes on the board are read better then.',
      geometry: 'With a chessboard or ChArUco board at 8 or more poses. Calibrate colours first.',
    },
    board: 'Board',
    boards: { chessboard: 'Chessboard', charuco: 'ChArUco' },
    boardSize: 'Its size',
    boardParts: {
      chessboard: 'Inner corners across and down, side of a square. All of it must be seen.',
      charuco: 'Squares across and down, their side, side of a marker, and its dictionary where it is not 4X4_50. A part of it may be hidden.',
    },
    start: 'Start',
    startTitle: 'The stream pauses meanwhile',
    actions: {
      take: ['Take', 'Take what the camera sees, once it holds still'],
      calculate: ['Calculate', 'Calibrate from the views taken'],
      keep: ['Keep', 'Write the rig file and go on streaming with it'],
      more: ['Take more', 'Not yet: go on'],
      cancel: ['Cancel', 'Go on streaming with the rig as it was'],
    },
    automatic: 'Take each pose that is held still',
    rest: (seen: number, of: number) => (seen < of ? `Moving: ${seen} of ${of} slides at rest` : 'At rest'),
    waits: (seen: number, of: number) => `Hold still: ${seen} of ${of} slides at rest`,
    restarted: 'The server was restarted: the calibration was lost, start again.',
    resultOf: (what: string, kept: boolean | null) =>
      kept === null ? what : `The last calibration: ${what.toLowerCase()}, ${kept ? 'kept' : 'not kept'}`,
    used: 'taken',
    notUsed: 'not used',
    result: {
      good: 'This is good.',
      weak: (colours: readonly string[]) =>
        `${colours.join(', ')}: hardly told from other colours. Check the projector's colours and the exposure.`,
      residualHigh: 'Far off: is there other light, or does the camera change its exposure by itself?',
      stereoHigh: 'Far off: is the board flat, and does it match what was typed? Take more views.',
      leftOutHigh: (px: string) =>
        `The corners left out are far off, ${px} px with them: does the projector show the pattern that the server was given, in the size that it was told?`,
      depthOpen: 'Not exact yet: take more views, tilted otherwise and in other parts of the picture.',
      residual: 'residual, of 255 (RMS)',
      columns: ['Colour', 'Margin', 'Residual'],
      stereo: 'corners from where the rig puts them (RMS)',
      all: 'the same with the corners left out',
      depth: 'depths there are known to',
      plane: 'corners from a plane (RMS)',
      squares: 'length of the squares (RMS)',
      baseline: 'from camera to projector',
      distance: 'the board was away',
      views: 'Residual of each view',
    },
  },
} as const;
