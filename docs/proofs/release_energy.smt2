; release_energy: theory §2.5. The energy of the hole is at least what is booked: the worst release at
; a = b + c, and for |F| >= 2 fco the friction of the way there and back that the ledger has not
; counted, n = |measured displacement| + w.
(set-logic QF_NRA)
(declare-const F Real)
(declare-const fco Real)
(declare-const a Real)
(declare-const b Real)
(declare-const c Real)
(declare-const along Real)
(declare-const n Real)
(declare-const H Real)      ; energy of the hole beyond what the ledger counts
(define-fun pos ((x Real)) Real (ite (> x 0) x 0))
(assert (and (>= fco 0) (>= c 0) (>= n 0)))
(assert (<= a (+ b c)))
(assert (>= F (* 2 fco)))  ; dropped in the twin
(assert (>= F 0))
(assert (>= H (- (* fco (pos (- (* 2 a) (* 2 c) along n))) (* F a))))
(assert (>= (* (- F (* 2 fco)) (- (+ b c) a)) 0))  ; hint
(assert (>= (* F (- (+ b c) a)) 0))  ; hint
(assert (>= (* fco (- (+ b c) a)) 0))  ; hint
(assert (>= (* fco (pos (- (* 2 a) (* 2 c) along n))) (* fco (- (* 2 a) (* 2 c) along n))))  ; hint
(assert (>= (* fco (pos (- (* 2 a) (* 2 c) along n))) 0))  ; hint
(assert (or (= (pos (- (* 2 b) along n)) 0) (= (pos (- (* 2 b) along n)) (- (* 2 b) along n))))  ; hint
(assert (< H (- (* fco (pos (- (* 2 b) along n))) (* F (+ b c)))))  ; negated conclusion
(check-sat)
