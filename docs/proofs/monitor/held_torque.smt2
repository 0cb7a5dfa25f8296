; held_torque: theory §3.2. Torques that are commanded at one place and held while the hand moves on
; make a force of at most r times that of the command: up to fco/r, Coulomb friction absorbs it at
; every place. Fp: force of the command; Fq: force where the hand is; g: its part along the velocity.
(set-logic QF_NRA)
(declare-const fco Real)
(declare-const r Real)
(declare-const Fp Real)
(declare-const Fq Real)
(declare-const g Real)
(declare-const v Real)
(assert (and (>= r 1) (>= Fp 0) (>= v 0) (<= g Fq)))
(assert (<= (* r Fp) fco))
(assert (<= Fq (* r Fp)))  ; dropped in the twin
(assert (>= (* v (- fco g)) 0))  ; hint
(assert (< (- (* fco v) (* g v)) 0))  ; negated conclusion
(check-sat)
