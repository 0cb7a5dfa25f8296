; three_pools: theory §2.4. Isotropic friction counted on three axes: each may count fco / sqrt(3).
(set-logic QF_NRA)
(declare-const fco Real)
(declare-const r Real)   ; sqrt(3)
(declare-const a Real)   ; |v_x|
(declare-const b Real)
(declare-const c Real)
(declare-const v Real)   ; |v|
(assert (and (>= fco 0) (>= a 0) (>= b 0) (>= c 0) (>= v 0) (= (* v v) (+ (* a a) (* b b) (* c c)))))
(assert (and (> r 0) (= (* r r) 3)))  ; dropped in the twin
(assert (>= (+ (* (- a b) (- a b)) (* (- b c) (- b c)) (* (- c a) (- c a))) 0))  ; hint
(assert (= (* r v r v) (* 3 (+ (* a a) (* b b) (* c c)))))  ; hint
(assert (=> (> (+ a b c) (* r v)) (> (* (+ a b c) (+ a b c)) (* r v r v))))  ; hint
(assert (>= (* fco (- (+ a b c) (* r v)) (ite (> (+ a b c) (* r v)) 1 0)) 0))  ; hint
(assert (=> (<= (+ a b c) (* r v)) (<= (* fco (+ a b c)) (* fco r v))))  ; hint
(assert (< (* fco v r) (* fco (+ a b c))))  ; negated conclusion
(check-sat)
