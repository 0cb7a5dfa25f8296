// SPDX-License-Identifier: Apache-2.0
// docs/glossary.md, found on the include path by the assembler.
  .section .rodata

  .global palpate_glossary, palpate_glossary_end
palpate_glossary:
  .incbin "glossary.md"
palpate_glossary_end:
  .byte 0

  .section .note.GNU-stack, "", %progbits
