// SPDX-License-Identifier: Apache-2.0
// docs/glossary.md and the tables of tasks and studies, found on the include path by the assembler.
  .section .rodata

  .global palpate_glossary, palpate_glossary_end
palpate_glossary:
  .incbin "glossary.md"
  .ascii "\n# Tasks\n"
  .incbin "tasks.md"
  .ascii "\n# Studies\n"
  .incbin "tasks/studies.md"
palpate_glossary_end:
  .byte 0

  .section .note.GNU-stack, "", %progbits
