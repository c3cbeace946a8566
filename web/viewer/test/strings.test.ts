// SPDX-License-Identifier: Apache-2.0
// Proves: the words that a page shows are all in its strings.ts. Reads the sources: what is given to an element as its text or name holds
// no words of its own. Why a frame cannot be decoded, which decoders say by throwing, is not of it.
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import ts from 'typescript';
import { expect, it } from 'vitest';

const kShown = new Set(['textContent', 'innerText', 'innerHTML', 'title', 'ariaLabel', 'placeholder', 'alt', 'label']);
const kWord = /\p{L}\p{Ll}{2,}/u; // PLY and GLB are called so everywhere

/** Of an expression that is shown: each literal with a word in it, also in parts of templates, sums and choices. */
function wordsOf(node: ts.Node): string[] {
  if (ts.isStringLiteral(node) || ts.isNoSubstitutionTemplateLiteral(node)) return kWord.test(node.text) ? [node.text] : [];
  if (ts.isTemplateExpression(node)) {
    const texts = [node.head.text, ...node.templateSpans.map((span) => span.literal.text)].filter((text) => kWord.test(text));
    return [...texts, ...node.templateSpans.flatMap((span) => wordsOf(span.expression))];
  }
  if (ts.isConditionalExpression(node)) return [...wordsOf(node.whenTrue), ...wordsOf(node.whenFalse)];
  if (ts.isParenthesizedExpression(node)) return wordsOf(node.expression);
  const joins = [ts.SyntaxKind.PlusToken, ts.SyntaxKind.QuestionQuestionToken, ts.SyntaxKind.BarBarToken];
  if (ts.isBinaryExpression(node) && joins.includes(node.operatorToken.kind)) return [...wordsOf(node.left), ...wordsOf(node.right)];
  return [];
}

/** What a node shows of itself. */
function shownBy(node: ts.Node): ts.Node[] {
  if (ts.isBinaryExpression(node) && node.operatorToken.kind === ts.SyntaxKind.EqualsToken) {
    return ts.isPropertyAccessExpression(node.left) && kShown.has(node.left.name.text) ? [node.right] : [];
  }
  if (ts.isPropertyAssignment(node) && ts.isIdentifier(node.name)) return kShown.has(node.name.text) ? [node.initializer] : [];
  if (!ts.isCallExpression(node)) return [];
  const isMethod = ts.isPropertyAccessExpression(node.expression); // classList.toggle() shows nothing
  const called = ts.isPropertyAccessExpression(node.expression) ? node.expression.name.text : node.expression.getText();
  if (called === 'make') return node.arguments.slice(2);
  if (called === 'setText') return node.arguments.slice(1);
  if (called === 'button') return node.arguments.slice(0, 2);
  if (!isMethod && (called === 'chooser' || called === 'toggle')) return node.arguments.slice(0, 1);
  if (called === 'append' && node.arguments.length === 2 && ts.isStringLiteral(node.arguments[0]!)) return []; // of a query: its key
  if (['append', 'prepend', 'replaceChildren', 'fillText'].includes(called)) return [...node.arguments];
  const named = called === 'setAttribute' && ts.isStringLiteral(node.arguments[0]!) && /^(title|aria-(label|valuetext|description))$/.test(node.arguments[0].text);
  return named ? [node.arguments[1]!] : [];
}

function strayWords(file: string, source: string): string[] {
  const tree = ts.createSourceFile(file, source, ts.ScriptTarget.Latest, true);
  const found: string[] = [];
  const visit = (node: ts.Node): void => {
    for (const shown of shownBy(node)) found.push(...wordsOf(shown).map((words) => `${file}: ${words}`));
    ts.forEachChild(node, visit);
  };
  visit(tree);
  return found;
}

it('finds words wherever they are shown', () => {
  const found = strayWords(
    'a.ts',
    "make('p', { title: 'One word' }, 'Two words', x ? `three ${n}` : 'A4'); box.textContent = text.ok; box.title = 'Four' + n; setText(box, 'Five five'); e.setAttribute('aria-label', 'Sixth'); e.setAttribute('class', 'seventh'); throw new Error('eighth');",
  );
  expect(found.map((line) => line.slice(6)).sort()).toEqual(['Five five', 'Four', 'One word', 'Sixth', 'Two words', 'three ']);
});

it('no words are shown that are not of strings.ts', () => {
  const folder = new URL('../src', import.meta.url).pathname;
  const files = readdirSync(folder, { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.ts') && !name.endsWith('strings.ts') && !name.endsWith('.d.ts'));
  expect(files.length).toBeGreaterThan(90);
  expect(files.flatMap((name) => strayWords(name, readFileSync(join(folder, name), 'utf8')))).toEqual([]);
});
